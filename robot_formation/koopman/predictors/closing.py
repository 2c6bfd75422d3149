"""Closing what the camera saw: residual and actuation bias are taken out of a model's data and put into its command.

A timestep's total displacement contains the change of the camera's residual: w_t = total_t + r_t - r_(t-1) is the part
that the leader induced, and w is what a model can forecast. The ideal move of the next timestep is w_(t+1) + r_t. What
the robot does differs from what it is told by its actuation bias b (slip, run-out), so the command is w^ + r^ - b^.

The camera's residual is noisy (a pixel of side length is 6 mm along u), so r and w are estimated together by a Kalman
filter: the total is known well, the camera says what is left. A model forecasts from the filtered w.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import Diagnostics, Matrix, Model, TrendFilter, Vector, array, covariance
from robot_formation.koopman.predictors.parameters import ClosingParameters

# A move that ends farther from its command has met an obstacle or was never carried out.
_LARGEST_BIAS_M = 0.03
# Degrees of freedom of the innovations' distribution (Student): an outlier must not decide.
NU = 5.0
_ONWARD = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


class ResidualFilter:
    """Bank of Kalman filters of residual r, leader-induced displacement w and its damped trend; each axis by itself.

    r_t = r_(t-1) + w_t + noise - total_t, w_(t+1) = w_t + damping trend_t + noise, and the camera measures r_t. The
    filters differ in how fast they let w change; they are weighted by the likelihood of their past innovations, older
    ones discounted. Shapes: (filters, axes, 3) for means (r, w, trend), (filters, axes, 3, 3) for covariances.
    """

    def __init__(self, parameters: ClosingParameters) -> None:
        p = self._p = parameters
        count = len(p.noise_m)
        self._camera = np.array([p.residual_u_m, p.residual_v_m]) ** 2
        start = np.array([[0.0, p.step_u_m, 0.0], [0.0, p.step_v_m, 0.0]])
        self._means = np.repeat(start[None], count, axis=0)
        sigmas = np.array(
            [[p.start_u_m, p.step_sigma_u_m, p.trend_start_m], [p.start_v_m, p.step_sigma_v_m, p.trend_start_m]]
        )
        self._covariances: NDArray[np.float64] = np.repeat((np.eye(3) * sigmas[:, None, :] ** 2)[None], count, axis=0)
        self._go = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, p.trend_damping], [0.0, 0.0, p.trend_damping]])
        self._noise = np.square(p.noise_m)[:, None]
        self._drift = np.zeros((count, 1, 3, 3))
        self._drift[:, 0, 1, 1] = np.square(p.level_m)
        self._drift[:, 0, 2, 2] = np.square(p.trend_m)
        self._losses: Matrix = np.zeros((count, 2))
        self.weights: Matrix = self._weighted()
        """Weight of each filter for each axis, (filters, axes)."""

    def observe(self, total: Vector, residual: Vector | None) -> None:
        """Update with the total displacement (2,) of a timestep and the camera's residual (2,), None if it saw none."""
        means = self._means @ _ONWARD.T
        means[..., 0] -= total
        covariances = _ONWARD @ self._covariances @ _ONWARD.T
        covariances[..., 0, 0] += self._noise
        if residual is not None:
            variances = covariances[..., 0, 0] + self._camera
            innovations = residual - means[..., 0]
            gains = covariances[..., 0] / variances[..., None]
            means = means + gains * innovations[..., None]
            covariances = covariances - gains[..., None] * covariances[..., :1, :]
            losses = (NU + 1.0) * np.log1p(innovations**2 / (NU * variances)) + np.log(variances)
            self._losses = self._p.discount * self._losses + losses
            self.weights = self._weighted()
        self._means = means @ self._go.T
        covariances = self._go @ covariances @ self._go.T + self._drift
        self._covariances = (covariances + np.swapaxes(covariances, -1, -2)) / 2.0

    def _weighted(self) -> Matrix:
        weights = np.exp(-0.5 * (self._losses - self._losses.min(axis=0)))
        return np.asarray(weights / weights.sum(axis=0))

    @property
    def residual(self) -> Vector:
        """Estimated residual (2,)."""
        return np.asarray((self.weights * self._means[..., 0]).sum(axis=0))

    @property
    def step(self) -> Vector:
        """Estimated leader-induced displacement of the timestep to come (2,)."""
        return np.asarray((self.weights * self._means[..., 1]).sum(axis=0))

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "means": self._means.tolist(),
            "covariances": self._covariances.tolist(),
            "losses": self._losses.tolist(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._means = array(state["means"], *self._means.shape)
        self._covariances = covariance(state["covariances"], *self._covariances.shape)
        self._losses = array(state["losses"], *self._losses.shape)
        self.weights = self._weighted()


class Closing:
    """A model of w, with the residual closed and the actuation bias learned."""

    def __init__(
        self, parameters: ClosingParameters, model: Model, judge: Callable[[Vector], None] | None = None
    ) -> None:
        """Wrap a model in residual feedback; `judge` is told every w as the camera saw it, before the model gets it."""
        self._model = model
        self._judge = judge
        self._filter = ResidualFilter(parameters)
        self._bias = TrendFilter(parameters.bias)
        self._bias.start(np.zeros(2), parameters.bias_m)
        self._seen = False

    def observe(self, displacement: Vector, residual: Vector | None, commanded: Vector | None) -> None:
        """Update with a timestep's total displacement, the camera's residual and the command, where they are known."""
        if commanded is not None:
            bias = displacement - commanded
            if np.abs(bias).max() <= _LARGEST_BIAS_M:
                self._bias.observe(bias)
        self._seen = self._seen or residual is not None
        if not self._seen:  # nothing is known about residuals: displacements are all there is
            self._model.observe(displacement)
            return
        if self._judge is not None and residual is not None:
            self._judge(displacement + residual - self._filter.residual)
        self._filter.observe(displacement, residual)
        self._model.observe(self._filter.step)

    def forecast(self) -> Vector:
        """Forecast the next ideal move (2,)."""
        return self._model.forecast() + self._filter.residual if self._seen else self._model.forecast()

    def bias(self) -> Vector:
        """By how much the robot is expected to go farther than it is told, (2,)."""
        return self._bias.forecast()

    def diagnostics(self) -> Diagnostics:
        """Show the inner model, and the filtered residual and the bias beside it."""
        inner = self._model.diagnostics()
        notes = dict(inner.notes or {})
        for name, value in (("residual [m]", self._filter.residual), ("actuation bias [m]", self.bias())):
            notes[name] = np.array2string(value, precision=6, separator=", ")
        return Diagnostics(inner.k, inner.condition_number, inner.innovation, notes)

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "model": self._model.state(),
            "filter": self._filter.state(),
            "bias": self._bias.state(),
            "seen": self._seen,
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._model.restore(state["model"])
        self._filter.restore(state["filter"])
        self._bias.restore(state["bias"])
        self._seen = bool(state["seen"])
