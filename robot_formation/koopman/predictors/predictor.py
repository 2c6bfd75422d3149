"""Predictors of the follower's next displacement, behind one protocol.

State x_t = (u_t, v_t): the follower's measured total displacement of timestep t, metres, u to the right and v forward.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot_formation.errors import FormationError
from robot_formation.koopman.predictors.closing import Closing
from robot_formation.koopman.predictors.dmd import Edmd, Literal, Measured
from robot_formation.koopman.predictors.formation import Mixture
from robot_formation.koopman.predictors.models import (
    Ewma,
    Insight,
    KalmanTrend,
    Matrix,
    Model,
    Previous,
    Vector,
    optional,
    vector,
)
from robot_formation.koopman.predictors.parameters import NAMES, PredictorParameters
from robot_formation.parameters import suggestion

# Nothing moves or is measured so finely: what is less is rounding, and dividing by it makes no sense.
_FINEST_M = 1e-9
CLOSE = "+close"

MODELS: dict[str, Callable[[PredictorParameters], Model]] = {
    "previous": Previous,
    "ewma": Ewma,
    "kalman_trend": KalmanTrend,
    "literal": Literal,
    "measured": Measured,
    "edmd": Edmd,
    "formation": Mixture,
}


@dataclass(frozen=True)
class Forecast:
    """What a predictor says of the next timestep; (u, v) in metres.

    Attributes:
        mean: (2,) the ideal move: the displacement that leaves no residual.
        covariance: (2, 2) of the ideal move about `mean` [m^2].
        command: (2,) what to command so that `mean` is what the robot does: without the actuation bias, where the
            predictor has learned one.
    """

    mean: Vector
    covariance: Matrix
    command: Vector

    @property
    def about_command(self) -> Matrix:
        """Second moment (2, 2) of the ideal move about `command` [m^2]."""
        bias = self.mean - self.command
        return self.covariance + np.outer(bias, bias)


class PredictionError(FormationError):
    """An observation was refused; the text says why. The predictor's state is unchanged."""


class Predictor:
    """A model with what every predictor owes its users: refusal of bad input, bounded output and a covariance."""

    def __init__(self, parameters: PredictorParameters) -> None:
        self.parameters = parameters
        name = parameters.name
        if name not in NAMES:
            raise PredictionError(f"no predictor '{name}'{suggestion(name, NAMES)}")
        self._model = MODELS[name.removesuffix(CLOSE)](parameters)
        self._closing: Closing | None = None
        if isinstance(self._model, Mixture):
            self._closing = Closing(parameters.closing, self._model, self._model.judge)
        elif name.endswith(CLOSE):
            self._closing = Closing(parameters.closing, self._model)
        self._errors: Matrix = np.diag([parameters.sigma_u_m, parameters.sigma_v_m]) ** 2 * parameters.sigma_weight
        self._weight = parameters.sigma_weight
        self._expected: Vector | None = None
        self.observations = 0

    @property
    def name(self) -> str:
        """The predictor's name."""
        return self.parameters.name

    def observe(self, displacement: Vector, residual: Vector | None = None, commanded: Vector | None = None) -> None:
        """Take a finished timestep: total displacement (2,), camera residual (2,), commanded displacement (2,).

        `commanded` is what the total would have been had the prediction move gone as commanded.

        Raises:
            PredictionError: if a component is not finite or longer than ten times the bound.
        """
        x = self._checked("displacement", displacement)
        x[np.abs(x) < _FINEST_M] = 0.0
        r = None if residual is None else self._checked("residual", residual)
        c = None if commanded is None else self._checked("commanded displacement", commanded)
        if self._expected is not None:
            error = (x if r is None else x + r) - self._expected
            self._errors = self._errors + np.outer(error, error)
            self._weight += 1.0
        if self._closing is not None:
            self._closing.observe(x, r, c)
            mean = self._closing.forecast()
        else:
            self._model.observe(x)
            mean = self._model.forecast()
        self.observations += 1
        self._expected = self._bounded(mean)

    def predict(self) -> Forecast:
        """Forecast the next timestep.

        Raises:
            PredictionError: before the first observation.
        """
        if self._expected is None:
            raise PredictionError("nothing to predict from: no displacement was observed yet")
        mean = self._expected.copy()
        command = mean if self._closing is None else self._bounded(mean - self._closing.bias())
        return Forecast(mean, self._errors / self._weight, command)

    def state(self) -> dict[str, Any]:
        """Take all that it has learned, as numbers, lists, text and None (JSON)."""
        return {
            "name": self.name,
            "model": self._model.state() if self._closing is None else self._closing.state(),
            "errors": self._errors.tolist(),
            "weight": self._weight,
            "expected": optional(self._expected),
            "observations": self.observations,
        }

    @classmethod
    def from_state(cls, parameters: PredictorParameters, state: Mapping[str, Any]) -> Predictor:
        """Make a predictor that goes on where another one's `state` was taken.

        Raises:
            PredictionError: if the state is damaged, or of a predictor with another name or other parameters.
        """
        predictor = cls(parameters)
        try:
            if state["name"] != parameters.name:
                raise ValueError(f"it is of '{state['name']}', not of '{parameters.name}'")
            (predictor._model if predictor._closing is None else predictor._closing).restore(state["model"])
            predictor._errors = np.array(state["errors"], dtype=float).reshape(2, 2)
            predictor._weight = float(state["weight"])
            predictor._expected = None if state["expected"] is None else vector(state["expected"])
            predictor.observations = int(state["observations"])
        except (KeyError, TypeError, ValueError) as error:
            raise PredictionError(f"the stored state of the predictor can't be used: {error}") from None
        return predictor

    def insight(self) -> Insight:
        """Show K, condition number and innovation where the model has them."""
        return self._model.insight() if self._closing is None else self._closing.insight()

    def _checked(self, what: str, value: Vector) -> Vector:
        x = np.array(value, dtype=float)
        u, v = x.tolist()
        if not np.isfinite(x).all():
            raise PredictionError(f"refused the {what} (u {u}, v {v}): not finite")
        if (np.abs(x) > 10.0 * self._bound).any():
            raise PredictionError(f"refused the {what} (u {u}, v {v}) m: no robot goes so far in a timestep")
        return x

    @property
    def _bound(self) -> Vector:
        return np.array([self.parameters.max_u_m, self.parameters.max_v_m])

    def _bounded(self, mean: Vector) -> Vector:
        return np.clip(np.nan_to_num(mean, nan=0.0, posinf=np.inf, neginf=-np.inf), -self._bound, self._bound)
