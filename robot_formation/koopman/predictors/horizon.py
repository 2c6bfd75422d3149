"""Forecasts of several timesteps, and how far such forecasts have been from what came.

A forecast of h timesteps has two errors: of the displacement of the h-th timestep, and of the way to its end. Their
second moments are averaged over the forecasts of the past, older ones discounted, beside a prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import Matrix, Vector, array, covariance
from robot_formation.koopman.predictors.spatial import after, between, ways

MOST_STEPS = 10
"""Timesteps ahead whose errors are observed; farther ones are scaled up from these."""


class Ahead(NamedTuple):
    """What a predictor says of a timestep to come; (u, v, turn) in metres and radians.

    Attributes:
        mean: (3,) the displacement of that timestep in the frame at its start. For the next timestep this is the ideal
            move, which takes the residual away; for those after it, what follows if none is left.
        covariance: (3, 3) of the displacement about `mean`.
        way: (3,) the ideal way from now to the end of that timestep, in the follower's frame now.
        way_covariance: (3, 3) of the way about `way`.
    """

    mean: Vector
    covariance: Matrix
    way: Vector
    way_covariance: Matrix


class HorizonErrors:
    """Discounted second moments of the errors of forecasts 1 to `MOST_STEPS` timesteps ahead."""

    def __init__(self, discount: float, prior_weight: float) -> None:
        self._discount, self._prior_weight = discount, prior_weight
        self._steps: NDArray[np.float64] = np.zeros((MOST_STEPS, 3, 3))
        self._ways: NDArray[np.float64] = np.zeros((MOST_STEPS, 3, 3))
        self._weights: NDArray[np.float64] = np.zeros((2, MOST_STEPS))
        # Forecasts not yet judged to their end, newest first: displacements, ways, and the way driven since.
        self._pending = np.zeros((0, MOST_STEPS, 3))
        self._expected = np.zeros((0, MOST_STEPS, 3))
        self._driven = np.zeros((0, 3))
        self._residual: Vector | None = None

    def forecast(self, steps: Matrix) -> None:
        """Keep forecast displacements (`MOST_STEPS`, 3) to compare them with what comes."""
        keep = MOST_STEPS - 1
        self._pending = np.concatenate([steps[None], self._pending[:keep]])
        self._expected = np.concatenate([ways(steps)[None], self._expected[:keep]])
        self._driven = np.concatenate([np.zeros((1, 3)), self._driven[:keep]])

    def observe(self, total: Vector, residual: Vector | None) -> None:
        """Compare with a timestep's total (3,) and the residual (3,) at its end, None if nobody saw it."""
        driven = self._driven = _all_after(self._driven, total)
        before, self._residual = self._residual, residual
        count = len(driven)
        if residual is None or not count:
            return
        numbers = np.arange(count)
        errors = _all_after(driven, residual) - self._expected[numbers, numbers]
        self._count(self._ways, 0, errors)
        if before is not None:
            w = between(before, after(total, residual))
            self._count(self._steps, 1, w - self._pending[numbers, numbers])

    def _count(self, moments: NDArray[np.float64], kind: int, errors: Matrix) -> None:
        """Add errors (n, 3) of forecasts 1 to n timesteps ahead."""
        count, keep = len(errors), self._discount
        moments[:count] = keep * moments[:count] + errors[:, :, None] * errors[:, None, :]
        self._weights[kind, :count] = keep * self._weights[kind, :count] + 1.0

    def covariances(self, first: Matrix, steps: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return covariances (steps, 3, 3) of displacements and of ways; `first` (3, 3) is that of the next one."""
        numbers = np.arange(1, steps + 1)
        known = np.minimum(numbers, MOST_STEPS) - 1
        beyond = (numbers / (known + 1.0))[:, None, None] ** 2
        weight = self._prior_weight
        growth = (known + 1.0)[:, None, None]
        of_steps = (weight * growth * first + self._steps[known]) / (weight + self._weights[1][known])[:, None, None]
        of_ways = (weight * growth**2 * first + self._ways[known]) / (weight + self._weights[0][known])[:, None, None]
        of_steps[0] = of_ways[0] = first
        return of_steps * beyond, of_ways * beyond

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {
            "steps": self._steps.tolist(),
            "ways": self._ways.tolist(),
            "weights": self._weights.tolist(),
            "pending": self._pending.tolist(),
            "driven": self._driven.tolist(),
            "residual": None if self._residual is None else self._residual.tolist(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._steps = covariance(state["steps"], *self._steps.shape)
        self._ways = covariance(state["ways"], *self._ways.shape)
        self._weights = array(state["weights"], *self._weights.shape)
        if (self._weights < 0.0).any():
            raise ValueError("a weight is negative")
        count = len(state["pending"])
        if count > MOST_STEPS:
            raise ValueError(f"more than {MOST_STEPS} forecasts are pending")
        self._pending = array(state["pending"], count, MOST_STEPS, 3) if count else np.zeros((0, MOST_STEPS, 3))
        self._driven = array(state["driven"], count, 3) if count else np.zeros((0, 3))
        self._expected = np.array([ways(steps) for steps in self._pending]).reshape(count, MOST_STEPS, 3)
        self._residual = None if state["residual"] is None else array(state["residual"], 3)


def _all_after(first: Matrix, second: Vector) -> Matrix:
    """Compose motions (n, 3) with one (3,) that follows each of them."""
    headings = first[:, 2]
    if not headings.any():
        return np.asarray(first + second)
    cosines, sines, (u, v, turn) = np.cos(headings), np.sin(headings), second.tolist()
    return np.asarray(first + np.stack([cosines * u - sines * v, sines * u + cosines * v, 0 * sines + turn], axis=1))
