"""Predictors of the follower's next displacement, behind one protocol.

State x_t = (u_t, v_t): the follower's measured total displacement of timestep t, metres, u to the right and v forward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from robot_formation.errors import FormationError
from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.linear_algebra import KoopmanError
from robot_formation.koopman.predictors.closing import Closing
from robot_formation.koopman.predictors.dmd import Edmd, Literal, Measured
from robot_formation.koopman.predictors.formation import Mixture
from robot_formation.koopman.predictors.models import (
    Diagnostics,
    Ewma,
    KalmanTrend,
    Matrix,
    Model,
    Previous,
    Vector,
    array,
    covariance,
    optional,
    vector,
)
from robot_formation.koopman.predictors.parameters import CLOSABLE, NAMES, PredictorParameters
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

DESCRIPTIONS: dict[str, str] = {
    "previous": 'the paper\'s "without prediction": the previous displacement',
    "ewma": "exponentially weighted moving average",
    "kalman_trend": "Kalman filter of a level with a damped trend",
    "measured": "online DMD with measured pairs: the paper's algorithm as it must be meant",
    "edmd": "online EDMD with a dictionary of yours (predictor.edmd.dictionary) and a prior",
    "literal": "the paper's Algorithm 1 as printed, which is blind after three displacements",
    "formation": "the project's own: residual and actuation bias closed, persistence and EDMD weighted",
    **{f"{name}{CLOSE}": f"{name}, with residual and actuation bias closed" for name in CLOSABLE},
}
"""What each of `NAMES` is, in a line."""


class Forecast(NamedTuple):
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
        # Plain numbers: NumPy's overhead on two of them would be most of a predictor's cost.
        self._weight = parameters.sigma_weight
        self._uu = parameters.sigma_u_m**2 * self._weight
        self._uv = 0.0
        self._vv = parameters.sigma_v_m**2 * self._weight
        self._largest_u_m, self._largest_v_m = 10.0 * parameters.max_u_m, 10.0 * parameters.max_v_m
        self._expected: Vector | None = None
        self.observations = 0

    @property
    def name(self) -> str:
        """The predictor's name."""
        return self.parameters.name

    def observe(self, displacement: Vector, residual: Vector | None = None, commanded: Vector | None = None) -> None:
        """Update with a finished timestep: total displacement (2,), camera residual (2,), commanded displacement (2,).

        `commanded` is what the total would have been had the prediction move gone as commanded.

        Raises:
            PredictionError: if a component is not finite or longer than ten times the bound.
        """
        x, u, v = self._checked("displacement", displacement)
        r = c = None
        residual_u = residual_v = 0.0
        if residual is not None:
            r, residual_u, residual_v = self._checked("residual", residual)
        if commanded is not None:
            c, _, _ = self._checked("commanded displacement", commanded)
        if abs(u) < _FINEST_M:
            x[0] = u = 0.0
        if abs(v) < _FINEST_M:
            x[1] = v = 0.0
        if self._closing is not None:
            self._closing.observe(x, r, c)
            mean = self._closing.forecast()
        else:
            self._model.observe(x)
            mean = self._model.forecast()
        if self._expected is not None:
            expected_u, expected_v = self._expected.tolist()
            error_u, error_v = u + residual_u - expected_u, v + residual_v - expected_v
            keep = self.parameters.sigma_discount
            self._uu = keep * self._uu + error_u * error_u
            self._uv = keep * self._uv + error_u * error_v
            self._vv = keep * self._vv + error_v * error_v
            self._weight = keep * self._weight + 1.0
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
        command = mean.copy() if self._closing is None else self._bounded(mean - self._closing.bias())
        uv = self._uv / self._weight
        return Forecast(mean, np.array(((self._uu / self._weight, uv), (uv, self._vv / self._weight))), command)

    def state(self) -> JsonObject:
        """Return all that it has learned, as numbers, lists, text and None (JSON)."""
        return {
            "name": self.name,
            "model": self._model.state() if self._closing is None else self._closing.state(),
            "errors": [[self._uu, self._uv], [self._uv, self._vv]],
            "weight": self._weight,
            "expected": optional(self._expected),
            "observations": self.observations,
        }

    @classmethod
    def from_state(cls, parameters: PredictorParameters, state: Mapping[str, Json]) -> Predictor:
        """Make a predictor that goes on where another one's `state` was taken.

        Raises:
            PredictionError: if the state is damaged, or of a predictor with another name or other parameters.
        """
        predictor = cls(parameters)
        try:
            if state["name"] != parameters.name:
                raise ValueError(f"it is of '{state['name']}', not of '{parameters.name}'")
            (predictor._model if predictor._closing is None else predictor._closing).restore(state["model"])
            (predictor._uu, predictor._uv), (_, predictor._vv) = covariance(state["errors"], 2, 2).tolist()
            predictor._weight = float(array(state["weight"]))
            if predictor._weight <= 0.0:
                raise ValueError("its weight is not positive")
            if state["expected"] is not None:
                predictor._expected = predictor._bounded(vector(state["expected"]))
            predictor.observations = int(state["observations"])
        except KeyError as error:
            raise PredictionError(f"the stored state of the predictor has no {error}") from None
        except (TypeError, ValueError, OverflowError, KoopmanError) as error:
            raise PredictionError(f"the stored state of the predictor can't be used: {error}") from None
        return predictor

    def diagnostics(self) -> Diagnostics:
        """Show K, condition number and innovation where the model has them."""
        return self._model.diagnostics() if self._closing is None else self._closing.diagnostics()

    def _checked(self, what: str, value: Vector) -> tuple[Vector, float, float]:
        """Return a copy of a vector (2,), and its components; refuse what no robot can do."""
        x = np.array(value, dtype=float)
        u, v = x.tolist()
        if abs(u) <= self._largest_u_m and abs(v) <= self._largest_v_m:  # never of NaN
            return x, u, v
        if not (math.isfinite(u) and math.isfinite(v)):
            raise PredictionError(f"refused the {what} (u {u}, v {v}): not finite")
        raise PredictionError(f"refused the {what} (u {u}, v {v}) m: no robot goes so far in a timestep")

    def _bounded(self, mean: Vector) -> Vector:
        u, v = mean.tolist()
        max_u_m, max_v_m = self.parameters.max_u_m, self.parameters.max_v_m
        if abs(u) <= max_u_m and abs(v) <= max_v_m:
            return mean
        return np.array([_clipped(u, max_u_m), _clipped(v, max_v_m)])


def _clipped(value: float, bound: float) -> float:
    return 0.0 if math.isnan(value) else max(-bound, min(bound, value))
