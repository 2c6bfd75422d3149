"""Predictors of the follower's next displacement, behind one protocol.

State x_t = (u_t, v_t, turn_t): the follower's measured total displacement of timestep t in its frame at the timestep's
start, u [m] to the right, v [m] forward, turn [rad] anticlockwise. A Koopman model's K is that of (u, v).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from robot_formation import plugins
from robot_formation.errors import FormationError
from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.linear_algebra import KoopmanError
from robot_formation.koopman.predictors.closing import Closing
from robot_formation.koopman.predictors.dmd import Edmd, Literal, Measured
from robot_formation.koopman.predictors.formation import MixedExperts
from robot_formation.koopman.predictors.horizon import MOST_STEPS, Ahead, HorizonErrors
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
from robot_formation.koopman.predictors.outside import OutsideModel
from robot_formation.koopman.predictors.parameters import (
    CLOSABLE,
    CLOSE,
    NAMES,
    TREND_CLOSE,
    PredictorParameters,
    is_outside_predictor,
)
from robot_formation.koopman.predictors.spatial import Spatial, after, between, ways
from robot_formation.parameters import suggestion

# Nothing moves or is measured so finely: what is less is rounding, and dividing by it makes no sense.
_FINEST_M = 1e-9
_FORMAT = 2  # of states; 1 knew no turns and had no number

MODELS: dict[str, Callable[[PredictorParameters], Model]] = {
    "previous": Previous,
    "ewma": Ewma,
    "kalman_trend": KalmanTrend,
    "literal": Literal,
    "measured": Measured,
    "edmd": Edmd,
}
"""Models of (u, v)."""

EXPERTS: dict[str, tuple[str, ...]] = {
    "formation": (
        "persistence", "trends", "oscillators", "overtones", "rotation", "dmd", "delays 3", "delays 6",
    ),
    TREND_CLOSE: ("trends",),
}  # fmt: skip
"""Predictors that are made of experts, and of which."""

TURN_MODELS: dict[str, Callable[[PredictorParameters, int], Model]] = {"ewma": Ewma, "kalman_trend": KalmanTrend}
"""Models of the turn by itself; for the others the previous turn."""

DESCRIPTIONS: dict[str, str] = {
    "previous": 'the paper\'s "without prediction": the previous displacement',
    "ewma": "exponentially weighted moving average",
    "kalman_trend": "Kalman filter of a level with a damped trend",
    "measured": "online DMD with measured pairs: the paper's algorithm as it must be meant",
    "edmd": "online EDMD with a dictionary of yours (predictor.edmd.dictionary) and a prior",
    "literal": "the paper's Algorithm 1 as printed, which is blind after three displacements",
    "formation": "the project's own: closing, with filters, Koopman oscillators and delay-embedded DMD weighted",
    **{f"{name}{CLOSE}": f"{name}, with residual and actuation bias closed" for name in CLOSABLE},
    TREND_CLOSE: "Kalman filters of levels and trends, with residual and actuation bias closed; no Koopman operator",
}
"""What each of `NAMES` is, in a line."""


class Forecast(NamedTuple):
    """What a predictor says of the next timestep; (u, v, turn) in metres and radians.

    Attributes:
        mean: (3,) the ideal move: the displacement that leaves no residual.
        covariance: (3, 3) of the ideal move about `mean` [m^2, m rad, rad^2].
        command: (3,) what to command so that `mean` is what the robot does: without the actuation bias, where the
            predictor has learned one.
    """

    mean: Vector
    covariance: Matrix
    command: Vector

    @property
    def about_command(self) -> Matrix:
        """Second moment (3, 3) of the ideal move about `command` [m^2, m rad, rad^2]."""
        bias = self.mean - self.command
        return self.covariance + np.outer(bias, bias)


class PredictionError(FormationError):
    """An observation was refused; the text says why. The predictor's state is unchanged."""


class Predictor:
    """A model with what every predictor owes its users: refusal of bad input, bounded output and a covariance."""

    def __init__(self, parameters: PredictorParameters) -> None:
        self.parameters = parameters
        name = parameters.name
        if name not in NAMES and not is_outside_predictor(name):
            raise PredictionError(f"no predictor '{name}'{suggestion(name, NAMES)}")
        inner = name.removesuffix(CLOSE)
        self._closing: Closing | MixedExperts | None = None
        if name in EXPERTS:
            self._closing = MixedExperts(parameters, EXPERTS[name])
        else:
            self._model = _model(inner, parameters)
            if name.endswith(CLOSE):
                self._closing = Closing(parameters.closing, self._model)
        self._weight = parameters.sigma_weight
        sigmas = np.array([parameters.sigma_u_m, parameters.sigma_v_m, parameters.sigma_turn_rad])
        self._errors: Matrix = np.diag(sigmas**2 * self._weight)
        self._horizon = HorizonErrors(parameters.sigma_discount, parameters.sigma_weight)
        self._bounds = np.array([parameters.max_u_m, parameters.max_v_m, parameters.max_turn_rad])
        self._largest = tuple((10.0 * self._bounds).tolist())
        self._expected: Vector | None = None
        self._seen = False
        self.observations = 0

    def __repr__(self) -> str:
        model = self._model if self._closing is None else self._closing
        return f"<Predictor '{self.name}' after {self.observations} observations: {model!r}>"

    @property
    def name(self) -> str:
        """The predictor's name."""
        return self.parameters.name

    def observe(
        self,
        displacement: Vector,
        residual: Vector | None = None,
        commanded: Vector | None = None,
        *,
        caught_up_rad: float = 0.0,
    ) -> None:
        """Update with a finished timestep: total displacement (3,), camera residual (3,), commanded displacement (3,).

        `commanded` is what the total would have been had the prediction move gone as commanded. The residual's turn
        may be NaN: the camera doesn't know it. Without a residual, the timestep was a blind one if there was a residual
        before: models go on by their own forecasts and learn nothing. If there never was one, displacements are all
        there is, and models learn from them.

        `caught_up_rad` is the standard deviation of what the displacement's turn makes good of earlier timesteps, whose
        residuals knew nothing of it. Models without residual feedback take no notice.

        Raises:
            PredictionError: if a vector has another shape, or a component is not finite or longer than ten times the
                bound.
        """
        if not (math.isfinite(caught_up_rad) and caught_up_rad >= 0.0):
            raise PredictionError(f"caught_up_rad is {caught_up_rad}; it must be finite and not negative")
        x = self._checked("displacement", displacement)
        r = None if residual is None else self._checked("residual", residual, turn_unknown=True)
        c = None if commanded is None else self._checked("commanded displacement", commanded)
        x[np.abs(x) < _FINEST_M] = 0.0
        blind = r is None and self._seen
        self._seen = self._seen or r is not None
        if self._closing is not None:
            self._closing.observe(x, r, c, caught_up_rad)
        elif blind:
            self._model.advance()
        else:
            self._model.observe(x)
        self._judge(x, r, blind)
        self.observations += 1
        steps = self._steps(MOST_STEPS)
        self._expected = steps[0]
        self._horizon.forecast(steps)

    def _judge(self, x: Vector, r: Vector | None, blind: bool) -> None:
        """Compare earlier forecasts with the ideal move of a timestep."""
        known = None if blind else np.zeros(3) if r is None else r
        if known is not None and math.isnan(known[2]):
            known = np.append(known[:2], 0.0)
        self._horizon.observe(x, known)
        if self._expected is None or known is None:
            return
        error = after(x, known) - self._expected
        self._errors = self.parameters.sigma_discount * self._errors + np.outer(error, error)
        self._weight = self.parameters.sigma_discount * self._weight + 1.0

    def predict(self) -> Forecast:
        """Forecast the next timestep.

        Raises:
            PredictionError: before the first observation.
        """
        if self._expected is None:
            raise PredictionError("nothing to predict from: no displacement was observed yet")
        mean = self._expected.copy()
        command = mean.copy() if self._closing is None else self._bounded(mean - self._closing.bias())
        return Forecast(mean, self._errors / self._weight, command)

    def step(self, residual: Vector | None) -> Vector:
        """Forecast what the leader will induce in the next timestep (3,), in the frame of the place without residual.

        Args:
            residual: the latest (3,), its turn may be NaN; None if unknown. Used where the predictor estimates none.

        Raises:
            PredictionError: before the first observation.
        """
        mean = self.predict().mean
        if self._closing is not None:
            return self._bounded(self._closing.step())
        return mean if residual is None else between(np.nan_to_num(residual), mean)

    def ahead(self, steps: int) -> list[Ahead]:
        """Forecast the next timesteps, 1 to `steps`.

        Raises:
            PredictionError: before the first observation, or if `steps` is not positive.
        """
        if steps < 1:
            raise PredictionError(f"a forecast is of 1 timestep or more, not of {steps}")
        first = self.predict().covariance
        means = self._steps(steps)
        covariances, way_covariances = self._horizon.covariances(first, steps)
        return list(map(Ahead, means, covariances, ways(means), way_covariances))

    def _steps(self, count: int) -> Matrix:
        """Forecast displacements (count, 3), bounded."""
        steps = (self._model if self._closing is None else self._closing).ahead(count)
        return self._bounded(steps)

    def state(self) -> JsonObject:
        """Return all that it has learned, as numbers, lists, text and None (JSON)."""
        return {
            "format": _FORMAT,
            "name": self.name,
            "model": self._model.state() if self._closing is None else self._closing.state(),
            "errors": self._errors.tolist(),
            "weight": self._weight,
            "horizon": self._horizon.state(),
            "expected": optional(self._expected),
            "seen": self._seen,
            "observations": self.observations,
        }

    @classmethod
    def from_state(cls, parameters: PredictorParameters, state: Mapping[str, Json]) -> Predictor:
        """Make a predictor that goes on where another one's `state` was taken.

        Raises:
            PredictionError: if the state is damaged, of an older version, or of a predictor with another name or other
                parameters.
        """
        predictor = cls(parameters)
        try:
            predictor._restore(state)
        except KeyError as error:
            raise PredictionError(f"the stored state of the predictor has no {error}") from None
        except (TypeError, ValueError, IndexError, OverflowError, KoopmanError) as error:
            raise PredictionError(f"the stored state of the predictor can't be used: {error}") from None
        return predictor

    def _restore(self, state: Mapping[str, Json]) -> None:
        if state["name"] != self.name:
            raise ValueError(f"it is of '{state['name']}', not of '{self.name}'")
        if state.get("format") != _FORMAT:
            raise ValueError("it was kept by an earlier version, which knew no turns; remove the file to begin anew")
        (self._model if self._closing is None else self._closing).restore(state["model"])
        self._errors = covariance(state["errors"], 3, 3)
        self._weight = float(array(state["weight"]))
        if self._weight <= 0.0:
            raise ValueError("its weight is not positive")
        self._horizon.restore(state["horizon"])
        if state["expected"] is not None:
            self._expected = self._bounded(vector(state["expected"], 3))
        self._seen = bool(state["seen"])
        self.observations = int(state["observations"])

    def diagnostics(self) -> Diagnostics:
        """Show K, condition number and innovation where the model has them."""
        return self._model.diagnostics() if self._closing is None else self._closing.diagnostics()

    def _checked(self, what: str, value: Vector, *, turn_unknown: bool = False) -> Vector:
        """Return a copy of a vector (3,); refuse what no robot can do."""
        x = np.array(value, dtype=float)
        if x.shape != (3,):
            raise PredictionError(f"refused the {what}: it must be (u, v, turn), shape (3,), not {x.shape}")
        u, v, turn = x.tolist()
        largest_u, largest_v, largest_turn = self._largest
        unknown = turn_unknown and math.isnan(turn)
        if abs(u) <= largest_u and abs(v) <= largest_v and (unknown or abs(turn) <= largest_turn):  # never of NaN
            return x
        text = f"refused the {what} (u {u} m, v {v} m, turn {turn} rad)"
        if not (math.isfinite(u) and math.isfinite(v) and (unknown or math.isfinite(turn))):
            raise PredictionError(f"{text}: not finite")
        raise PredictionError(f"{text}: no robot goes so far in a timestep")

    def _bounded(self, mean: Vector) -> Vector:
        """Return vectors (..., 3) within the bounds, NaN as zero."""
        found = np.clip(mean, -self._bounds, self._bounds)
        return np.where(np.isnan(found), 0.0, found)


def _model(name: str, parameters: PredictorParameters) -> Spatial | OutsideModel:
    """Make the model of this name.

    Raises:
        PluginError: if it is of another package and can't be used.
    """
    if name not in MODELS:
        return OutsideModel(name, plugins.load("predictor", name))
    return Spatial(MODELS[name](parameters), TURN_MODELS.get(name, Previous)(parameters, 1))
