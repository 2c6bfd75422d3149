"""Predictors of the follower's next displacement, behind one protocol.

State x_t = (u_t, v_t): the follower's measured total displacement of timestep t, metres, u to the right and v forward.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot_formation.errors import FormationError
from robot_formation.koopman.online_dmd import OnlineDMD
from robot_formation.parameters import parameter, suggestion

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

# Nothing moves or is measured so finely: what is less is rounding, and dividing by it makes no sense.
_FINEST_M = 1e-9
# An open-loop power of K may grow as it likes; this is far beyond any forecast and far below overflow.
_LARGEST_STATE_M = 1e100


@dataclass(frozen=True)
class PredictorParameters:
    """Which predictor runs, and its parameters."""

    name: str = parameter("measured", "Predictor", choices=("previous", "literal", "measured"))
    forgetting: float = parameter(
        1.0, "Weight of a pair relative to the next newer one ('measured'); 1 forgets nothing", low=0.01, high=1.0
    )
    max_u_m: float = parameter(0.1, "Bound of the forecast along u", unit="m", low=0.0, high=10.0)
    max_v_m: float = parameter(0.2, "Bound of the forecast along v", unit="m", low=0.0, high=10.0)
    sigma_m: float = parameter(
        0.005, "Standard deviation of a forecast before there are innovations to tell", unit="m", low=0.0, high=1.0
    )


@dataclass(frozen=True)
class Forecast:
    """Forecast of the next displacement: mean (2,) = (u, v) [m] and covariance (2, 2) [m^2]."""

    mean: Vector
    covariance: Matrix


@dataclass(frozen=True)
class Insight:
    """What the model looks like inside, for diagnostics; absent parts are None."""

    k: Matrix | None = None
    condition_number: float | None = None
    innovation: Vector | None = None

    @property
    def eigenvalues(self) -> NDArray[np.complex128] | None:
        """Eigenvalues of K, the finite-dimensional Koopman operator."""
        return None if self.k is None else np.linalg.eigvals(self.k).astype(complex)


class Model(Protocol):
    """A one-step model: it is shown each displacement once, in order, and forecasts the next."""

    def observe(self, x: Vector) -> None:
        """Take the measured displacement (2,) of a timestep."""

    def forecast(self) -> Vector:
        """Forecast the next displacement (2,); called after at least one observation."""

    def insight(self) -> Insight:
        """Show K and its quality where the model has them."""


class Previous:
    """The paper's baseline, "without prediction": the previous timestep's displacement."""

    def __init__(self, parameters: PredictorParameters) -> None:
        self._last: Vector = np.zeros(2)

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        self._last = x

    def forecast(self) -> Vector:
        """See `Model`."""
        return self._last

    def insight(self) -> Insight:
        """See `Model`."""
        return Insight()


class Literal:
    """The paper's Algorithm 1 as printed: K from the first three displacements, then K^n x_3, blind to what follows.

    The printed loop feeds its own forecast back as the measurement, so its innovation y - K x is zero and K stays.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._collected: list[Vector] = []
        self._k: Matrix | None = None
        self._state: Vector = np.zeros(2)

    def observe(self, x: Vector) -> None:
        """See `Model`; from the fourth on only the number of observations matters."""
        if self._k is not None:
            self._state = np.clip(self._k @ self._state, -_LARGEST_STATE_M, _LARGEST_STATE_M)
            return
        self._collected.append(x)
        self._state = x
        if len(self._collected) == 3:
            data = np.column_stack(self._collected)
            self._k = data[:, 1:] @ np.linalg.pinv(data[:, :-1])

    def forecast(self) -> Vector:
        """See `Model`."""
        return self._state if self._k is None else self._k @ self._state

    def insight(self) -> Insight:
        """See `Model`."""
        condition = None
        if self._k is not None:
            condition = float(np.linalg.cond(np.column_stack(self._collected[:-1])))
        return Insight(k=self._k, condition_number=condition)


class Measured:
    """Online DMD with measured pairs: what the paper's algorithm must have been to react to anything.

    Forecast K x_t, with K the least-squares fit of all pairs (x_i, x_i+1) so far; the previous displacement until the
    first two pairs are complete, as in the paper's collection phase.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._dmd = OnlineDMD(2, forgetting=parameters.forgetting)
        self._pairs = 0
        self._last: Vector | None = None
        self._innovation: Vector | None = None

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        if self._last is not None:
            self._innovation = self._dmd.update(self._last, x)
            self._pairs += 1
        self._last = x

    def forecast(self) -> Vector:
        """See `Model`."""
        assert self._last is not None  # by the protocol
        return self._last if self._pairs < 2 else self._dmd.k @ self._last

    def insight(self) -> Insight:
        """See `Model`."""
        if self._pairs < 2:
            return Insight()
        return Insight(self._dmd.k, self._dmd.condition_number, self._innovation)


MODELS: dict[str, Callable[[PredictorParameters], Model]] = {
    "previous": Previous,
    "literal": Literal,
    "measured": Measured,
}


class PredictionError(FormationError):
    """An observation was refused; the text says why. The predictor's state is unchanged."""


@dataclass
class Predictor:
    """A model with what every predictor owes its users: refusal of bad input, bounded output and a covariance.

    The covariance is the mean outer product of the errors of its own past forecasts, `sigma_m` counted as one of them.
    """

    parameters: PredictorParameters
    observations: int = 0
    _model: Model = field(init=False)
    _errors: Matrix = field(init=False)
    _expected: Vector | None = None

    def __post_init__(self) -> None:
        if self.parameters.name not in MODELS:
            raise PredictionError(f"no predictor '{self.parameters.name}'{suggestion(self.parameters.name, MODELS)}")
        self._model = MODELS[self.parameters.name](self.parameters)
        self._errors = np.eye(2) * self.parameters.sigma_m**2

    @property
    def name(self) -> str:
        """The model's name."""
        return self.parameters.name

    def observe(self, u_m: float, v_m: float) -> None:
        """Take the displacement of a finished timestep.

        Raises:
            PredictionError: if a component is not finite or longer than ten times the bound.
        """
        x = np.array([u_m, v_m], dtype=float)
        limit = 10.0 * np.array([self.parameters.max_u_m, self.parameters.max_v_m])
        if not np.isfinite(x).all():
            raise PredictionError(f"refused the displacement (u {u_m}, v {v_m}): not finite")
        if (np.abs(x) > limit).any():
            raise PredictionError(f"refused the displacement (u {u_m}, v {v_m}) m: no robot goes so far in a timestep")
        x[np.abs(x) < _FINEST_M] = 0.0
        if self._expected is not None:
            error = x - self._expected
            self._errors = self._errors + np.outer(error, error)
        self._model.observe(x)
        self.observations += 1
        self._expected = self._bounded(self._model.forecast())

    def predict(self) -> Forecast:
        """Forecast the next displacement.

        Raises:
            PredictionError: before the first observation.
        """
        if self._expected is None:
            raise PredictionError("nothing to predict from: no displacement was observed yet")
        return Forecast(self._expected.copy(), self._errors / self.observations)

    def insight(self) -> Insight:
        """Show K, condition number and innovation where the model has them."""
        return self._model.insight()

    def _bounded(self, mean: Vector) -> Vector:
        bound = np.array([self.parameters.max_u_m, self.parameters.max_v_m])
        return np.clip(np.nan_to_num(mean, nan=0.0, posinf=np.inf, neginf=-np.inf), -bound, bound)
