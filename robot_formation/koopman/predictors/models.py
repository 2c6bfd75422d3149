"""Models of a sequence of displacements: what they share, and those without an operator.

State x_t = (u_t, v_t), metres, u to the right and v forward; or the turn (1,), radians, by itself.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.parameters import PredictorParameters, TrendParameters
from robot_formation.koopman.quality import EigenvalueQuality

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

NU = 5.0
"""Degrees of freedom of the errors' distribution (Student): an outlier must not decide."""


@dataclass(frozen=True)
class Diagnostics:
    """What the model looks like inside, for diagnostics; absent parts are None."""

    k: Matrix | None = None
    condition_number: float | None = None
    innovation: Vector | None = None
    notes: Mapping[str, str] | None = None
    weights: Mapping[str, Mapping[str, float]] | None = None
    """Of a predictor's experts, by axis and name."""
    consistency: float | None = None
    """Consistency index of the dictionary; see `consistency_index`."""
    qualities: Sequence[EigenvalueQuality] | None = None
    """What the newest pairs say of K's eigenvalues."""

    @property
    def eigenvalues(self) -> NDArray[np.complex128] | None:
        """Eigenvalues of K, the finite-dimensional Koopman operator."""
        return None if self.k is None else np.linalg.eigvals(self.k).astype(complex)


class Model(Protocol):
    """A model of vectors (n,): it is shown each one once, in order, and forecasts the next ones."""

    def observe(self, x: Vector) -> None:
        """Update with the measured displacement (n,) of a timestep."""

    def advance(self) -> None:
        """Go on by a timestep that nobody measured: by the model's own forecast, without learning."""

    def forecast(self) -> Vector:
        """Forecast the next displacement (n,); called after at least one observation."""

    def ahead(self, steps: int) -> Matrix:
        """Forecast the next displacements, (steps, n); the first is `forecast`."""

    def diagnostics(self) -> Diagnostics:
        """Show K and its quality where the model has them."""

    def state(self) -> JsonObject:
        """Return all that it has learned, as numbers, lists and None."""

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned from a model with the same parameters."""


class Previous:
    """The paper's baseline, "without prediction": the previous timestep's displacement."""

    def __init__(self, parameters: PredictorParameters, size: int = 2) -> None:
        self._last: Vector = np.zeros(size)

    def __repr__(self) -> str:
        return "Previous()"

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        self._last = x

    def advance(self) -> None:
        """See `Model`."""

    def forecast(self) -> Vector:
        """See `Model`."""
        return self._last

    def ahead(self, steps: int) -> Matrix:
        """See `Model`."""
        return np.repeat(self._last[None], steps, axis=0)

    def diagnostics(self) -> Diagnostics:
        """See `Model`."""
        return Diagnostics()

    def state(self) -> JsonObject:
        """See `Model`."""
        return {"last": self._last.tolist()}

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        self._last = vector(state["last"], len(self._last))


class Ewma:
    """Exponentially weighted moving average: the smoothing that any forecast of noisy displacements has to beat."""

    def __init__(self, parameters: PredictorParameters, size: int = 2) -> None:
        self._gain = parameters.ewma.gain
        self._size = size
        self._mean: Vector | None = None

    def __repr__(self) -> str:
        return f"Ewma(gain={self._gain:g})"

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        self._mean = x if self._mean is None else self._mean + self._gain * (x - self._mean)

    def advance(self) -> None:
        """See `Model`."""

    def forecast(self) -> Vector:
        """See `Model`."""
        assert self._mean is not None  # by the protocol
        return self._mean

    def ahead(self, steps: int) -> Matrix:
        """See `Model`."""
        return np.repeat(self.forecast()[None], steps, axis=0)

    def diagnostics(self) -> Diagnostics:
        """See `Model`."""
        return Diagnostics()

    def state(self) -> JsonObject:
        """See `Model`."""
        return {"mean": optional(self._mean)}

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        self._mean = None if state["mean"] is None else vector(state["mean"], self._size)


class TrendFilter:
    """Kalman filter of level and damped trend, all axes by themselves but with the same gains.

    level' = level + damping trend + noise, trend' = damping trend + noise, measured = level + noise (local linear
    trend model with damping; Harvey, "Forecasting, structural time series models and the Kalman filter", 1989).
    """

    def __init__(self, parameters: TrendParameters, size: int = 2) -> None:
        self._p = parameters
        self._size = size
        self._transition = np.array([[1.0, parameters.damping], [0.0, parameters.damping]])
        self._change = np.diag([parameters.level_m**2, parameters.trend_m**2])
        self._state: Matrix | None = None  # rows: level and trend of the timestep to come; columns: axes
        self._covariance: Matrix = np.zeros((2, 2))

    def start(self, level: Vector, sigma_m: float) -> None:
        """Begin with a prior of the level (n,) of the first timestep."""
        self._state = np.stack([level, np.zeros(self._size)])
        self._covariance = np.diag([sigma_m**2, self._p.start_trend_m**2])

    def observe(self, x: Vector) -> None:
        """Update with a value (n,); the first one is the level if there was no prior."""
        noise = self._p.noise_m**2
        if self._state is None:
            self._state = np.stack([x, np.zeros(self._size)])
            self._covariance = np.diag([noise, self._p.start_trend_m**2])
        else:
            gain = self._covariance[:, 0] / (self._covariance[0, 0] + noise)
            self._state = self._state + gain[:, None] * (x - self._state[0])
            self._covariance = self._covariance - gain[:, None] * self._covariance[0]
        self.advance()

    def advance(self) -> None:
        """Go on by a timestep; without a value if `observe` didn't call it."""
        if self._state is None:
            return
        f = self._transition
        self._state = f @ self._state
        covariance = f @ self._covariance @ f.T + self._change
        self._covariance = (covariance + covariance.T) / 2.0

    def forecast(self) -> Vector:
        """Forecast the next value (n,); zero before there is any."""
        return np.zeros(self._size) if self._state is None else self._state[0].copy()

    def ahead(self, steps: int) -> Matrix:
        """Forecast the next values, (steps, n)."""
        if self._state is None:
            return np.zeros((steps, self._size))
        shares = np.cumsum(self._p.damping ** np.arange(steps)) - 1.0  # of the trend, which is damped before it counts
        return np.asarray(self._state[0] + shares[:, None] * self._state[1])

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "state": None if self._state is None else self._state.tolist(),
            "covariance": self._covariance.tolist(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._state = None if state["state"] is None else array(state["state"], 2, self._size)
        self._covariance = covariance(state["covariance"], 2, 2)


class KalmanTrend:
    """Kalman filter of a level with a damped trend."""

    def __init__(self, parameters: PredictorParameters, size: int = 2) -> None:
        self._filter = TrendFilter(parameters.kalman_trend, size)

    def __repr__(self) -> str:
        return "KalmanTrend()"

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        self._filter.observe(x)

    def advance(self) -> None:
        """See `Model`."""
        self._filter.advance()

    def forecast(self) -> Vector:
        """See `Model`."""
        return self._filter.forecast()

    def ahead(self, steps: int) -> Matrix:
        """See `Model`."""
        return self._filter.ahead(steps)

    def diagnostics(self) -> Diagnostics:
        """See `Model`."""
        return Diagnostics()

    def state(self) -> JsonObject:
        """See `Model`."""
        return self._filter.state()

    def restore(self, state: Mapping[str, Json]) -> None:
        """See `Model`."""
        self._filter.restore(state)


def vector(values: ArrayLike, size: int = 2) -> Vector:
    """Read a vector from a state.

    Raises:
        ValueError: if it has another length, or is not finite.
    """
    return array(values, size)


def array(values: ArrayLike, *shape: int) -> NDArray[np.float64]:
    """Read an array of this shape from a state.

    Raises:
        ValueError: if it has another shape, or is not finite.
    """
    found = np.array(values, dtype=float)
    if found.shape != shape or not np.isfinite(found).all():
        raise ValueError(f"finite numbers of shape {shape} are expected")
    return found


def covariance(values: ArrayLike, *shape: int) -> NDArray[np.float64]:
    """Read covariance matrices of this shape (..., n, n) from a state.

    Raises:
        ValueError: if they have another shape, or are none.
    """
    found = array(values, *shape)
    turned = np.swapaxes(found, -1, -2)
    eigenvalues = np.linalg.eigvalsh(found)  # ascending
    largest = abs(eigenvalues[..., -1])
    if (abs(found - turned) > 1e-9 * largest[..., None, None]).any() or (eigenvalues[..., 0] < -1e-9 * largest).any():
        raise ValueError("covariance matrices are expected")
    return found


def packed(values: NDArray[np.float64]) -> str:
    """Write an array into a state, as text (base64 of little-endian doubles): exact, and short for long ones."""
    return base64.b64encode(values.astype("<f8").tobytes()).decode("ascii")


def unpacked(text: str, *shape: int) -> NDArray[np.float64]:
    """Read an array of this shape that `packed` wrote.

    Raises:
        ValueError: if it is damaged, has another shape, or is not finite.
    """
    if not isinstance(text, str):
        raise ValueError(f"packed numbers of shape {shape} are expected")
    values = np.frombuffer(base64.b64decode(text, validate=True), dtype="<f8")
    if values.size != math.prod(shape):
        raise ValueError(f"{math.prod(shape)} packed numbers are expected, not {values.size}")
    return array(values.reshape(shape), *shape)


def optional(values: Vector | None) -> list[float] | None:
    """Write a vector that may be missing into a state."""
    return None if values is None else [float(value) for value in values]
