"""Aggregation of experts' forecasts: weights that follow the experts' errors so far."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import NU, Vector, array


class Aggregation(Protocol):
    """Weights of experts of one quantity."""

    @property
    def weights(self) -> Vector:
        """Weights (experts,) that add up to 1."""

    def observe(self, forecasts: Vector, value: float) -> None:
        """Judge the experts' forecasts (experts,) by the value that came."""

    def state(self) -> JsonObject:
        """Return all that it has learned."""

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""


class MlPoly:
    """Weights without a learning rate, after ML-Poly (Gaillard, Stoltz and van Erven, "A second-order bound with excess
    losses", COLT 2014), whose losses are never much larger than the best expert's.

    Expert k has the weight p_k ~ prior_k eta_k max(R_k, 0), R_k being the sum of its instantaneous regrets r_k, and
    eta_k = 1 / (B^2 + sum r_k^2) its own learning rate, B the largest |r_k| so far. For the square loss regrets are
    those of its gradient. Prior and B, which stands for a bound known beforehand, are additions.
    """

    def __init__(self, prior: Vector, scale: float) -> None:
        """Begin with the prior (experts,), which adds up to 1; losses are in units of `scale` squared."""
        self._prior, self._scale = prior, scale
        self._regrets: NDArray[np.float64] = np.zeros(len(prior))
        self._squares: NDArray[np.float64] = np.zeros(len(prior))
        self._largest = 0.0

    @property
    def weights(self) -> Vector:
        """Weights (experts,) that add up to 1."""
        gains = self._prior * np.maximum(self._regrets, 0.0) / (self._largest**2 + self._squares + 1e-300)
        total = gains.sum()
        return self._prior if total <= 0.0 else np.asarray(gains / total)

    def observe(self, forecasts: Vector, value: float) -> None:
        """Judge the experts' forecasts (experts,) by the value that came."""
        mixed = float(self.weights @ forecasts)
        regrets = 2.0 * (mixed - value) * (mixed - forecasts) / self._scale**2
        self._regrets = self._regrets + regrets
        self._squares = self._squares + regrets**2
        self._largest = max(self._largest, float(np.abs(regrets).max()))

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "regrets": self._regrets.tolist(),
            "squares": self._squares.tolist(),
            "largest": self._largest,
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._regrets = array(state["regrets"], len(self._prior))
        self._squares = array(state["squares"], len(self._prior))
        self._largest = float(array(state["largest"]))
        if (self._squares < 0.0).any() or self._largest < 0.0:
            raise ValueError("a sum of squares is negative")


class ExponentialWeights:
    """Discounted exponential weights by the likelihood of a Student distribution of errors; no bound is proved."""

    def __init__(self, prior: Vector, scale: float, discount: float) -> None:
        """Begin with the prior (experts,); errors are in units of `scale`."""
        self._prior, self._scale, self._discount = np.log(prior), scale, discount
        self.newest: Vector = np.zeros(len(prior))
        """The newest loss of each expert, (experts,)."""
        self._losses: NDArray[np.float64] = np.zeros(len(prior))

    @property
    def weights(self) -> Vector:
        """Weights (experts,) that add up to 1."""
        logs = self._prior - 0.5 * self._losses
        weights = np.exp(logs - logs.max())
        return np.asarray(weights / weights.sum())

    def observe(self, forecasts: Vector, value: float) -> None:
        """Judge the experts' forecasts (experts,) by the value that came."""
        errors = ((forecasts - value) / self._scale) ** 2
        self.newest = (NU + 1.0) * np.log1p(errors / NU)
        self._losses = self._discount * self._losses + self.newest

    def add(self, losses: Vector) -> None:
        """Add to the experts' losses, where they were the first experts: a share of those of another axis."""
        self._losses[: len(losses)] += losses

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {"losses": self._losses.tolist()}

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._losses = array(state["losses"], len(self._prior))
