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
from robot_formation.koopman.predictors.models import Matrix, Vector, array
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
        self._pending: list[tuple[Matrix, Matrix, Vector]] = []
        self._residual: Vector | None = None

    def forecast(self, steps: Matrix) -> None:
        """Keep forecast displacements (`MOST_STEPS`, 3) to compare them with what comes."""
        self._pending = [(steps, ways(steps), np.zeros(3)), *self._pending[: MOST_STEPS - 1]]

    def observe(self, total: Vector, residual: Vector | None) -> None:
        """Compare with a timestep's total (3,) and the residual (3,) at its end, None if nobody saw it."""
        self._pending = [(steps, way, after(driven, total)) for steps, way, driven in self._pending]
        before, self._residual = self._residual, residual
        if residual is None:
            return
        w = None if before is None else between(before, after(total, residual))
        for number, (steps, way, driven) in enumerate(self._pending):
            self._count(self._ways, 0, number, after(driven, residual) - way[number])
            if number and w is not None:
                self._count(self._steps, 1, number, w - steps[number])

    def _count(self, moments: NDArray[np.float64], kind: int, number: int, error: Vector) -> None:
        moments[number] = self._discount * moments[number] + np.outer(error, error)
        self._weights[kind, number] = self._discount * self._weights[kind, number] + 1.0

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
            "pending": [[steps.tolist(), driven.tolist()] for steps, _, driven in self._pending],
            "residual": None if self._residual is None else self._residual.tolist(),
        }

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._steps = array(state["steps"], *self._steps.shape)
        self._ways = array(state["ways"], *self._ways.shape)
        self._weights = array(state["weights"], *self._weights.shape)
        if (self._weights < 0.0).any():
            raise ValueError("a weight is negative")
        pending = [(array(steps, MOST_STEPS, 3), array(driven, 3)) for steps, driven in state["pending"]]
        self._pending = [(steps, ways(steps), driven) for steps, driven in pending[:MOST_STEPS]]
        self._residual = None if state["residual"] is None else array(state["residual"], 3)
