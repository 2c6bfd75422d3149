"""Banks of Kalman filters of residual and leader-induced displacement, weighted by the likelihood of what came.

Each filter has a state x = (r, z): the residual r of one axis, or of two, and a hidden state z whose linear readout C z
is the leader-induced displacement w of the timestep to come. In a timestep r becomes r + C z + noise - total, the
camera measures r, and z goes on by T z + noise. T is what distinguishes the filters: a level, a level with a trend, or
a rotation, whose eigenvalues lie on the unit circle. Forecasts of several timesteps are readouts of powers of T.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import NU, Matrix, Vector, covariance, packed, unpacked


@dataclass(frozen=True)
class BankModel:
    """What the filters of a bank assume; `count` filters, `size` states, of which the first `seen` are residuals.

    Attributes:
        axes: (count, seen) which of u, v and turn each residual is.
        onward: (count, size, size) T beside the identity of the residuals: the state's change after the measurement.
        readout: (count, seen, size) C: zero for the residuals.
        noise: (count, size, size) covariance that is added after the measurement.
        jitter: (count, seen) variance of w about its readout.
        means: (count, size) at first.
        covariances: (count, size, size) at first.
        losses: (count,) -2 log of the weights at first.
    """

    axes: NDArray[np.int64]
    onward: NDArray[np.float64]
    readout: NDArray[np.float64]
    noise: NDArray[np.float64]
    jitter: NDArray[np.float64]
    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    losses: NDArray[np.float64]


class FilterBank:
    """The filters of a `BankModel`, in batches."""

    def __init__(self, model: BankModel, discount: float, horizon: int) -> None:
        """Make a bank that forgets past innovations by `discount` and is asked for up to `horizon` timesteps ahead."""
        self._m = model
        self._discount = discount
        self.means = model.means.copy()
        self._covariances = model.covariances.copy()
        self._prior = model.losses
        self._losses = np.zeros(len(model.losses))
        self._seen = model.axes.shape[1]
        self._readout_turned = np.swapaxes(model.readout, 1, 2)
        self._onward_turned = np.swapaxes(model.onward, 1, 2)
        rows = [model.readout]
        for _ in range(horizon - 1):
            rows.append(rows[-1] @ model.onward)
        self._rows = np.stack(rows, axis=1)  # (count, horizon, seen, size)

    def observe(self, total: Vector, residual: Vector, camera: Vector, unsure: Vector | None = None) -> None:
        """Update with a timestep's total (3,) and the residual (3,) at its end, told in the frame at its start.

        `camera` (3,) is the residual's variance, `unsure` (3,) that of the total as a measure of what the leader did. A
        component of the residual that nobody saw is NaN.
        """
        m, seen = self._m, self._seen
        means = self.means.copy()
        means[:, :seen] += np.einsum("bij,bj->bi", m.readout, self.means) - total[m.axes]
        covariances = self._covariances.copy()  # of (r + C z, z): rows of r first, then its columns
        covariances[:, :seen] += m.readout @ covariances
        covariances[:, :, :seen] += covariances @ self._readout_turned
        for j in range(seen):
            covariances[:, j, j] += m.jitter[:, j] + (0.0 if unsure is None else unsure[m.axes[:, j]])
        values, variances_seen = residual[m.axes], camera[m.axes]
        known = np.isfinite(values)
        if known.any():
            losses = np.where(known.any(axis=1), self._discount * self._losses, self._losses)
            for j in range(seen):
                variances = covariances[:, j, j] + variances_seen[:, j]
                innovations = np.where(known[:, j], values[:, j] - means[:, j], 0.0)
                gains = covariances[:, :, j] * (known[:, j] / variances)[:, None]
                means = means + gains * innovations[:, None]
                covariances = covariances - gains[:, :, None] * covariances[:, j, None, :]
                newest = (NU + 1.0) * np.log1p(innovations**2 / (NU * variances)) + np.log(variances)
                losses = losses + np.where(known[:, j], newest, 0.0)
            self._losses = losses
        self.means = np.einsum("bij,bj->bi", m.onward, means)
        covariances = m.onward @ covariances @ self._onward_turned + m.noise
        self._covariances = (covariances + np.swapaxes(covariances, 1, 2)) / 2.0

    @property
    def losses(self) -> NDArray[np.float64]:
        """-2 log of the weights (count,), with the prior."""
        return np.asarray(self._losses + self._prior)

    def ahead(self, steps: int) -> NDArray[np.float64]:
        """Leader-induced displacements to come of every filter, (count, steps, seen)."""
        rows = self._rows
        while rows.shape[1] < steps:
            rows = np.concatenate([rows, rows[:, -1:] @ self._m.onward[:, None]], axis=1)
        return np.asarray(np.einsum("bhsj,bj->bhs", rows[:, :steps], self.means))

    def shift(self, change: Vector) -> None:
        """Add a change (3,) to every filter's residual."""
        self.means[:, : self._seen] += change[self._m.axes]

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "means": packed(self.means),
            "covariances": packed(self._covariances),
            "losses": packed(self._losses),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self.means = unpacked(state["means"], *self.means.shape)
        self._covariances = covariance(
            unpacked(state["covariances"], *self._covariances.shape), *self._covariances.shape
        )
        self._losses = unpacked(state["losses"], *self._losses.shape)


def weighted(losses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weights that add up to 1 from -2 log of them."""
    weights = np.exp(-0.5 * (losses - losses.min()))
    return np.asarray(weights / weights.sum())


def conditioned(mean: Vector, cov: Matrix, row: Vector, value: float, sigma: float) -> tuple[Vector, Matrix]:
    """Condition a normal distribution on row . x = value +- sigma: what is known of the first displacement."""
    variance = float(row @ cov @ row) + sigma**2
    gain = cov @ row / variance
    return mean + gain * (value - row @ mean), cov - np.outer(gain, row @ cov)
