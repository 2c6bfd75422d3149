"""What the filter takes the neighbour's next step to be: the predictor's forecast, as certain as it has proved to be.

How exactly a forecast tells the way aside decides how much of the heading follows from the steps: 1 mm on 5 cm is 1.1
degrees. Its own covariance contains the camera's noise and is too wide for a leader that drives straight ahead. So
several step models are kept side by side; each look tells how likely each of them was, older looks count less
(multiple-model estimation: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.parameters import parameter

Matrix = NDArray[np.float64]

# All chosen.
_FIRST_SIDESTEP_SIGMA_M = 0.002
"""Standard deviation of the neighbour's way aside in its first step, before the follower knows its own slip."""
_DISCOUNT = 0.85
"""Weight of a look's likelihoods after one more: some seven looks count."""
_TURN_SCALE = 0.3
"""Bound on the factor by which the standard deviation of a forecast turn counts."""
_FIRST_ASIDE_SHARE = 0.5
"""Error of the first step's way aside, share of what its turn leads aside: nothing has been seen of its slip yet."""
_LEAST_TURN_RAD = 0.02
"""A forecast turn below this counts as none: it is made of errors of the follower's own heading."""
_TURNING_RAD, _SURE_ASIDE_M = 0.03, 0.008
"""Turn from which on the way aside of a step ahead is the forecast's, and the most that this may be unsure."""
_LEG_LOSS_M, _SHORT_LEG_M = 0.002, 0.004
"""How far a leg aside ends short, and the length from which on the loss falls as the length grows
(bench/small_moves.py: legs of 3.5, 5, 8 and 20 mm reach 1.5, 3.2, 7.1 and 19.6 mm)."""
_FORECAST_ASIDE = 0.5
"""Share of the forecast in a turning step's way aside; the rest follows from the arc. A forecast alone would repeat
what an error of the heading has taught it, the arc alone knows no slip."""
_MOST_COST = 9.0
"""Bound on what a look charges a model more than the best one."""


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
    turn_share: float = parameter(0.07, "Error of the neighbour's turn, share of it", low=0.0, high=1.0)
    aside_share: float = parameter(
        0.15, "Error of its way aside, share of what its turn leads aside", low=0.0, high=10.0
    )
    forecast_aside_sigma_m: float = parameter(
        0.001, "Error of a forecast step aside, least", unit="m", low=0.0, high=1.0
    )
    scales: tuple[float, ...] = parameter(
        (0.3, 1.0),
        "Step models by forecast: factors by which the forecast's standard deviations count",
        low=0.0,
        high=100.0,
    )
    forecast_cost: float = parameter(
        3.0, "-2 log likelihood of a step by forecast beforehand; of a step ahead: 0", low=0.0, high=100.0
    )
    change_cost: float = parameter(
        6.0, "-2 log likelihood of a step that nothing foretells, beforehand", low=0.0, high=100.0
    )
    change_sigma_m: float = parameter(
        0.03, "Way of such a step beside the forecast, standard deviation", unit="m", low=0.0, high=1.0
    )
    change_sigma_rad: float = parameter(
        0.03, "Turn of such a step beside the forecast, standard deviation", unit="rad", low=0.0, high=1.0
    )
    bend_cost: float = parameter(
        4.0, "-2 log likelihood of a step on an arc of another radius than forecast, beforehand", low=0.0, high=100.0
    )
    bend_sigma_rad: float = parameter(
        0.05, "Turn of such a step beside the forecast, standard deviation", unit="rad", low=0.0, high=1.0
    )


@dataclass(frozen=True)
class Drives:
    """What the follower knows of its own drives: way aside and overshoot, shares of the way, and how many they were."""

    slip: float = 0.0
    overshoot: float = 0.0
    count: int = 0


@dataclass(frozen=True)
class StepModel:
    """The neighbour's step in its own frame, covariance (3, 3) of (x, y, yaw), and the share of slip that is in it."""

    step: Motion
    covariance: Matrix
    slip_included: float


class StepModels:
    """Keeps the models' likelihoods."""

    def __init__(self, parameters: StepParameters, least_leg_m: float, wheel_lever_m: float) -> None:
        """Begin without a look.

        Args:
            parameters: of the models.
            least_leg_m: leg aside up to which a drive doesn't turn its wheels; the neighbour's is as the follower's.
            wheel_lever_m: way of the wheels per radian of a turn; robots slip on it too.
        """
        self._p = p = parameters
        self._least_leg_m = least_leg_m
        self._wheel_lever_m = wheel_lever_m
        self._before = [0.0, *(p.forecast_cost for _ in p.scales), p.change_cost, p.bend_cost]
        self._seen = [0.0] * len(self._before)

    @property
    def costs(self) -> list[float]:
        """-2 log likelihood of each model."""
        return [before + seen for before, seen in zip(self._before, self._seen, strict=True)]

    def models(self, step: UncertainMotion, own: Drives, inflation: float, first: bool) -> list[StepModel]:
        """List the models of a step: ahead on an arc, by forecast with several covariances, a change, and another arc.

        Args:
            step: the forecast in the neighbour's frame.
            own: the follower's own drives.
            inflation: factor by which the least noise aside counts.
            first: whether it is the first step, which is known beforehand.
        """
        p, mean = self._p, step.mean
        if abs(mean.yaw_rad) < _LEAST_TURN_RAD:
            mean = Motion(mean.x_m, mean.y_m)
        aside_m = _FIRST_SIDESTEP_SIGMA_M if own.count == 0 else p.aside_sigma_m * inflation
        turned = self._turned(mean)
        least = turned + _diagonal(p.length_sigma_m, aside_m, p.turn_sigma_rad)
        if first:
            unsure = _diagonal(0.0, _FIRST_ASIDE_SHARE * mean.x_m * mean.yaw_rad, 0.0)
            return [StepModel(self._driven(mean, own), least + unsure, 0.0)]
        arc = Motion(mean.x_m, mean.x_m * math.tan(0.5 * mean.yaw_rad), mean.yaw_rad)
        # In turns the way aside has many parts: the predictor has seen their sum, where it is sure of it.
        turning = abs(mean.yaw_rad) > _TURNING_RAD and step.matrix[1, 1] < _SURE_ASIDE_M**2
        floor = turned + _diagonal(p.length_sigma_m, max(aside_m, p.forecast_aside_sigma_m), p.turn_sigma_rad)
        ahead = self._driven(arc, own)
        share = _FORECAST_ASIDE if turning else 0.0
        ahead = replace(ahead, y_m=ahead.y_m + share * (mean.y_m - ahead.y_m))
        bend = np.array([0.0, 0.5 * mean.x_m, 1.0]) * p.bend_sigma_rad
        return [
            StepModel(ahead, least, share),
            *(StepModel(mean, floor + _scaled(step.matrix, scale), 1.0) for scale in p.scales),
            StepModel(mean, step.matrix + _diagonal(p.change_sigma_m, p.change_sigma_m, p.change_sigma_rad), 1.0),
            StepModel(ahead, least + np.outer(bend, bend), share),
        ]

    def _driven(self, step: Motion, own: Drives) -> Motion:
        """Return what a drive makes of a step: it slips aside, and legs aside end short or are not driven at all."""
        turn, forward, left = step.legs
        loss_m = _LEG_LOSS_M * min(1.0, _SHORT_LEG_M / max(abs(left), _LEG_LOSS_M))
        driven_m = abs(left) - loss_m if abs(left) >= self._least_leg_m else 0.0
        step = Motion.from_legs(turn, forward, math.copysign(max(driven_m, 0.0), left))
        way_m = abs(step.x_m) + self.turning_way_m(step)  # down the slope, ahead or back
        return Motion(step.x_m, step.y_m + own.slip * way_m, step.yaw_rad)

    def turning_way_m(self, step: Motion) -> float:
        """Return the way [m] that the wheels make for a step's turn."""
        return self._wheel_lever_m * abs(step.yaw_rad)

    def _turned(self, step: Motion) -> Matrix:
        """Return the covariance that comes of a step's turn: the way follows the turn as it was made."""
        p, turn = self._p, step.yaw_rad
        by_turn = np.array([0.0, step.x_m, 1.0]) * p.turn_share * turn
        return np.outer(by_turn, by_turn) + _diagonal(0.0, p.aside_share * step.x_m * turn, 0.0)

    def judge(self, costs: Iterable[tuple[int, float]]) -> None:
        """Process a look: -2 log likelihoods of the hypotheses with their models' numbers, the model's own included."""
        own, least = self.costs, [math.inf] * len(self._before)
        for number, cost in costs:
            least[number] = min(least[number], cost - own[number])
        if not all(map(math.isfinite, least)):
            return  # one model for all, or none
        best = min(least)
        seen = [_DISCOUNT * old + min(new - best, _MOST_COST) for old, new in zip(self._seen, least, strict=True)]
        self._seen = [value - min(seen) for value in seen]


def _scaled(covariance: Matrix, scale: float) -> Matrix:
    """Scale a forecast's standard deviations; that of the turn is mostly the error of the follower's own heading."""
    factors = np.array([scale, scale, min(scale, _TURN_SCALE)])
    return np.asarray(factors[:, None] * covariance * factors)


def _diagonal(x_m: float, y_m: float, yaw_rad: float) -> Matrix:
    return np.diag([x_m**2, y_m**2, yaw_rad**2])
