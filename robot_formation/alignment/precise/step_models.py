"""What the filter takes the neighbour's next step to be: the predictor's forecast, as certain as it has proved to be.

How exactly a forecast tells the way aside decides how much of the heading follows from the steps: 1 mm on 5 cm is 1.1
degrees. Its own covariance contains the camera's noise and is too wide for a leader that drives straight ahead. So
several step models are kept side by side; each look tells how likely each of them was, older looks count less
(multiple-model estimation: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.parameters import parameter

Matrix = NDArray[np.float64]

_FIRST_SIDESTEP_SIGMA_M = 0.002
"""Standard deviation of the neighbour's way aside in its first step, before the follower knows its own slip."""
_DISCOUNT = 0.85
"""Weight of a look's likelihoods after one more: some seven looks count."""
_MOST_COST = 9.0
"""Bound on what a look charges a model more than the best one, and on how far a model falls behind."""


@dataclass(frozen=True)
class StepParameters:
    """How certain the neighbour's step is."""

    length_sigma_m: float = parameter(
        0.02, "Error of the forecast step along the neighbour's heading, least", unit="m", low=0.0, high=1.0
    )
    aside_sigma_m: float = parameter(
        0.0005,
        "How far a step ahead leads aside, least; more where the NIS after steps is high",
        unit="m",
        low=0.0,
        high=1.0,
    )
    turn_sigma_rad: float = parameter(
        0.003, "Error of the forecast turn, least: the neighbour also turns by slip", unit="rad", low=0.0, high=1.0
    )
    forecast_aside_sigma_m: float = parameter(
        0.001, "Error of a forecast step aside, least", unit="m", low=0.0, high=1.0
    )
    scales: tuple[float, ...] = parameter(
        (0.0, 0.3, 1.0, 2.0), "Step models by forecast: factors by which its standard deviations count", low=0.0, high=100.0
    )
    straight_cost: float = parameter(0.0, "-2 log likelihood of a step straight ahead beforehand", low=-100.0, high=100.0)
    forecast_cost: float = parameter(4.0, "-2 log likelihood of a step by forecast beforehand", low=-100.0, high=100.0)


@dataclass(frozen=True)
class Drives:
    """What the follower knows of its own drives: way aside and overshoot, shares of the way, and how many they were."""

    slip: float = 0.0
    overshoot: float = 0.0
    count: int = 0


@dataclass(frozen=True)
class StepModel:
    """The neighbour's step in its own frame, the covariance (3, 3) of (x, y, yaw), and whether slip is in it already."""

    step: Motion
    covariance: Matrix
    slip_included: bool


class StepModels:
    """Keeps the models' likelihoods.

    Attributes:
        costs: -2 log likelihood of each model, the likeliest 0.
    """

    def __init__(self, parameters: StepParameters) -> None:
        self._p = parameters
        self.costs = [parameters.straight_cost, *(parameters.forecast_cost for _ in parameters.scales)]

    def models(self, step: UncertainMotion, own: Drives, inflation: float, first: bool) -> list[StepModel]:
        """List the models of a step: straight ahead, and by forecast with several covariances.

        Args:
            step: the forecast in the neighbour's frame.
            own: the follower's own drives.
            inflation: factor by which the least noise aside counts.
            first: whether it is the first step, which is known beforehand.
        """
        p, mean = self._p, step.mean
        aside_m = _FIRST_SIDESTEP_SIGMA_M if own.count == 0 else p.aside_sigma_m * inflation
        ahead = Motion(mean.x_m, mean.x_m * math.tan(0.5 * mean.yaw_rad) + own.slip * mean.x_m, mean.yaw_rad)
        least = np.diag([p.length_sigma_m**2, aside_m**2, p.turn_sigma_rad**2])
        if first:
            known = Motion(mean.x_m, mean.y_m + own.slip * mean.x_m, mean.yaw_rad)
            return [StepModel(known, least, False)]
        found = [StepModel(ahead, least, False)]
        floor = np.diag([p.length_sigma_m**2, max(aside_m, p.forecast_aside_sigma_m) ** 2, p.turn_sigma_rad**2])
        found += [StepModel(mean, floor + scale**2 * step.matrix, True) for scale in p.scales]
        return found

    def judge(self, costs: Iterable[tuple[int, float]]) -> None:
        """Process a look: the -2 log likelihoods of the hypotheses by model number, the model's own included."""
        least = [math.inf] * len(self.costs)
        for number, cost in costs:
            least[number] = min(least[number], cost - self.costs[number])
        best = min(least)
        if all(map(math.isfinite, least)):
            self.costs = _behind(
                [_DISCOUNT * old + min(new - best, _MOST_COST) for old, new in zip(self.costs, least, strict=True)]
            )


def _behind(costs: Sequence[float]) -> list[float]:
    return [min(cost - min(costs), _MOST_COST) for cost in costs]
