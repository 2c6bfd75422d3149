"""Closing what the camera saw: residual and actuation bias are taken out of a model's data and put into its command.

A timestep's total displacement contains the change of the camera's residual: w_t = total_t + r_t - r_(t-1) is the part
that the leader induced, and w is what a model can forecast. The ideal move of the next timestep is w_(t+1) + r_t. What
the robot does differs from what it is told by its actuation bias b (slip, run-out), so the command is w^ + r^ - b^.

The camera's residual is noisy (a pixel of side length is 6 mm along u), so r and w are estimated together by a Kalman
filter: the total is known well, the camera says what is left. A model forecasts from the filtered w.

With turns, r and w are motions in the plane: the ideal motion is total_t o r_t = r_(t-1) o w_t, o being composition
(the second motion's translation is rotated by the first one's turn). Without any turn this is the sum above.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import NU, Diagnostics, Matrix, TrendFilter, Vector, array, covariance
from robot_formation.koopman.predictors.outside import OutsideModel
from robot_formation.koopman.predictors.parameters import ClosingParameters
from robot_formation.koopman.predictors.spatial import Spatial, after, rotated

# A move that ends farther from its command has met an obstacle or was never carried out.
_LARGEST_BIAS_M = 0.03
_LARGEST_BIAS_RAD = 0.1
_ONWARD = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


class ResidualFilter:
    """Bank of Kalman filters of residual r, leader-induced displacement w and its damped trend; each axis by itself.

    The axes are u and v, or the turn alone.

    r_t = r_(t-1) + w_t + noise - total_t, w_(t+1) = w_t + damping trend_t + noise, and the camera measures r_t. The
    filters differ in how fast they let w change; they are weighted by the likelihood of their past innovations, older
    ones discounted. Shapes: (filters, axes, 3) for means (r, w, trend), (filters, axes, 3, 3) for covariances.
    """

    def __init__(self, parameters: ClosingParameters, *, turn: bool = False) -> None:
        """Make the bank of u and v [m], or that of the turn [rad], whose lists are those of u and v times a scale."""
        p = self._p = parameters
        count = len(p.noise_m)
        scale = p.rad_per_m if turn else 1.0
        if turn:
            self._camera = np.array([p.residual_turn_rad]) ** 2
            start = np.array([[0.0, p.step_turn_rad, 0.0]])
            sigmas = np.array([[p.start_turn_rad, p.step_sigma_turn_rad, scale * p.trend_start_m]])
        else:
            self._camera = np.array([p.residual_u_m, p.residual_v_m]) ** 2
            start = np.array([[0.0, p.step_u_m, 0.0], [0.0, p.step_v_m, 0.0]])
            sigmas = np.array(
                [[p.start_u_m, p.step_sigma_u_m, p.trend_start_m], [p.start_v_m, p.step_sigma_v_m, p.trend_start_m]]
            )
        self._means = np.repeat(start[None], count, axis=0)
        self._covariances: NDArray[np.float64] = np.repeat((np.eye(3) * sigmas[:, None, :] ** 2)[None], count, axis=0)
        self._go = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, p.trend_damping], [0.0, 0.0, p.trend_damping]])
        self._noise = np.square(scale * np.array(p.noise_m))[:, None]
        self._drift = np.zeros((count, 1, 3, 3))
        self._drift[:, 0, 1, 1] = np.square(scale * np.array(p.level_m))
        self._drift[:, 0, 2, 2] = np.square(scale * np.array(p.trend_m))
        self._losses: Matrix = np.zeros((count, len(start)))
        self.weights: Matrix = self._weighted()
        """Weight of each filter for each axis, (filters, axes)."""

    def observe(self, total: Vector, residual: Vector | None, unsure: float = 0.0) -> None:
        """Update with the total (axes,) of a timestep and the camera's residual (axes,), None if it saw none.

        `unsure` is the variance of the total as a measure of what the leader did.
        """
        means = self._means @ _ONWARD.T
        means[..., 0] -= total
        covariances = _ONWARD @ self._covariances @ _ONWARD.T
        covariances[..., 0, 0] += self._noise + unsure
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
        """Estimated residual (axes,)."""
        return np.asarray((self.weights * self._means[..., 0]).sum(axis=0))

    @property
    def step(self) -> Vector:
        """Estimated leader-induced displacement of the timestep to come (axes,)."""
        return np.asarray((self.weights * self._means[..., 1]).sum(axis=0))

    def shift(self, change: Vector) -> None:
        """Add a change (axes,) to every filter's residual: the frame in which it is told has changed."""
        self._means[..., 0] += change

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


class ClosedResidual:
    """Residual and leader-induced motion w as (u, v, turn), estimated by a bank of u and v and one of the turn."""

    def __init__(self, parameters: ClosingParameters) -> None:
        self._uv = ResidualFilter(parameters)
        self._turn = ResidualFilter(parameters, turn=True)
        self.seen = False
        """Whether any residual was known yet."""
        self.turn_seen = False
        """Whether any residual's turn was known yet."""

    def observe(self, total: Vector, residual: Vector | None, caught_up_rad: float = 0.0) -> None:
        """Update with a timestep's total (3,) and the residual (3,) at its end; its turn may be NaN, unknown.

        `caught_up_rad`: see `Predictor.observe`.
        """
        turn_seen = residual is not None and not math.isnan(residual[2])
        before = float(self._turn.residual[0]) if self.turn_seen else 0.0
        self.seen = self.seen or residual is not None
        self.turn_seen = self.turn_seen or turn_seen
        if self.turn_seen:
            seen_turn = residual[2:] if turn_seen and residual is not None else None
            self._turn.observe(total[2:], seen_turn, caught_up_rad**2)
        if before:  # w is told in the frame of the place that the robot should have had
            self._uv.shift(rotated(self._uv.step, before) - self._uv.step)
        turn = float(total[2])
        seen = None if residual is None else rotated(residual[:2], turn)
        self._uv.observe(total[:2], seen)
        if turn:  # the filter's residual is told in the frame at the timestep's start; on to that at its end
            self._uv.shift(rotated(self._uv.residual, -turn) - self._uv.residual)

    @property
    def residual(self) -> Vector:
        """Estimated residual (3,)."""
        return np.append(self._uv.residual, self._turn.residual if self.turn_seen else 0.0)

    @property
    def step(self) -> Vector:
        """Estimated leader-induced displacement (u, v) of the timestep to come, (2,)."""
        return self._uv.step

    @property
    def turn_step(self) -> Vector:
        """Estimated leader-induced turn of the timestep to come, (1,)."""
        return self._turn.step

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "uv": self._uv.state(),
            "turn": self._turn.state(),
            "seen": self.seen,
            "turn_seen": self.turn_seen,
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._uv.restore(state["uv"])
        self._turn.restore(state["turn"])
        self.seen, self.turn_seen = bool(state["seen"]), bool(state["turn_seen"])


class ActuationBias:
    """By how much the robot goes farther than it is told, (u, v, turn); found by a filter of level and trend."""

    def __init__(self, parameters: ClosingParameters) -> None:
        self._uv, self._turn = TrendFilter(parameters.bias), TrendFilter(parameters.bias, 1)
        self._uv.start(np.zeros(2), parameters.bias_m)
        self._turn.start(np.zeros(1), parameters.bias_m)  # the gains depend on ratios only: metres do for radians

    def observe(self, displacement: Vector, commanded: Vector) -> None:
        """Update with a total (3,) and what it would have been had the robot gone as told (3,)."""
        bias = displacement - commanded
        if np.abs(bias[:2]).max() <= _LARGEST_BIAS_M and abs(bias[2]) <= _LARGEST_BIAS_RAD:
            self._uv.observe(bias[:2])
            self._turn.observe(bias[2:])

    def forecast(self) -> Vector:
        """Forecast the bias of the next timestep (3,)."""
        return np.append(self._uv.forecast(), self._turn.forecast())

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {"uv": self._uv.state(), "turn": self._turn.state()}

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._uv.restore(state["uv"])
        self._turn.restore(state["turn"])


class Closing:
    """A model of w, with the residual closed and the actuation bias learned."""

    def __init__(self, parameters: ClosingParameters, model: Spatial | OutsideModel) -> None:
        """Wrap a model in residual feedback."""
        self._model = model
        self._filter = ClosedResidual(parameters)
        self._bias = ActuationBias(parameters)

    def __repr__(self) -> str:
        return f"Closing({self._model!r})"

    def observe(
        self,
        displacement: Vector,
        residual: Vector | None,
        commanded: Vector | None,
        caught_up_rad: float = 0.0,
    ) -> None:
        """Update with a timestep's total displacement, the camera's residual and the command, where they are known.

        `caught_up_rad`: see `Predictor.observe`.
        """
        if commanded is not None:
            self._bias.observe(displacement, commanded)
        found, blind = self._filter, residual is None
        if blind and not found.seen:  # nothing is known about residuals: displacements are all there is
            self._model.observe(displacement)
            return
        found.observe(displacement, residual, caught_up_rad)
        if blind:
            self._model.advance()
        else:
            self._model.observe(np.append(found.step, found.turn_step if found.turn_seen else displacement[2:]))

    def forecast(self) -> Vector:
        """Forecast the next ideal move (3,)."""
        return np.asarray(self.ahead(1)[0])

    def ahead(self, steps: int) -> Matrix:
        """Forecast the next displacements (steps, 3): the next ideal move, then what follows if nothing is left."""
        found = self._model.ahead(steps)
        if self._filter.seen:
            residual = self._filter.residual
            found[0] = after(residual, found[0])
        return found

    def step(self) -> Vector:
        """Forecast what the leader will induce next (3,), in the frame of the place where no residual is left."""
        return np.asarray(self._model.ahead(1)[0])

    def bias(self) -> Vector:
        """By how much the robot is expected to go farther than it is told, (3,)."""
        return self._bias.forecast()

    def diagnostics(self) -> Diagnostics:
        """Show the inner model, and the filtered residual and the bias beside it."""
        inner = self._model.diagnostics()
        notes = dict(inner.notes or {})
        residual, bias = self._filter.residual, self.bias()
        for name, value in (("residual [m]", residual[:2]), ("actuation bias [m]", bias[:2])):
            notes[name] = np.array2string(value, precision=6, separator=", ")
        for name, turn in (("residual turn [rad]", residual[2]), ("actuation bias of the turn [rad]", bias[2])):
            notes[name] = f"{turn:.6g}"
        return replace(inner, notes=notes)

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {"model": self._model.state(), "filter": self._filter.state(), "bias": self._bias.state()}

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._model.restore(state["model"])
        self._filter.restore(state["filter"])
        self._bias.restore(state["bias"])
