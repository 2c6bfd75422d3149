"""Checks of the heading within a timestep: a follower and a marker of which everything is known but to the follower."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from alignment_helpers import blocks_of, state_of
from robot_formation.alignment.mode import Decision, Verdict
from robot_formation.alignment.precise.marker_projection import Vector, after_motion, pose_of
from robot_formation.alignment.precise.precise_mode import PreciseAlignment, PreciseParameters
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.slots import slot
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.vision.pixy2.block import Block

Camera = Callable[[Vector], list[Block]]
FORMATION = Motion(y_m=-FORMATION_DISTANCE_M)
SURE = np.diag([0.001**2, 0.001**2, 0.01**2])


class Pair:
    """A follower that makes what is decided, exactly, and its neighbour."""

    def __init__(self, camera: Camera = blocks_of, max_moves: int = PreciseParameters.max_moves) -> None:
        self.alignment = PreciseAlignment(PreciseParameters(max_moves=max_moves), slot(FORMATION_DISTANCE_M))
        self.timestep = 1
        self.camera = camera
        self.truth = state_of()
        self.alignment.restart(0)
        self.align()

    def step(self, forecast: Motion, made: Motion) -> list[Decision]:
        """Let the neighbour make a step, in its own frame, and the follower follow by the forecast and align."""
        pose = pose_of(self.truth)
        step = UncertainMotion.of(forecast, SURE).between(FORMATION.inverse(), FORMATION)
        self.alignment.restart(self.timestep, step)
        self.timestep += 1
        after = pose.then(made)
        self.truth = np.array([after.x_m, after.y_m, after.yaw_rad, *self.truth[3:]])
        self.move(step.mean)
        return self.align()

    def move(self, motion: Motion) -> None:
        self.truth = after_motion(self.truth, motion)
        self.alignment.moved(motion, motion)

    def align(self) -> list[Decision]:
        decisions = [self.alignment.assess([self.camera(self.truth)])]
        while decisions[-1].verdict in (Verdict.MOVE, Verdict.SEARCH, Verdict.LOOK):
            self.move(decisions[-1].motion)
            decisions.append(self.alignment.assess([self.camera(self.truth)]))
            assert len(decisions) < 40
        return decisions

    @property
    def heading_deg(self) -> float:
        return math.degrees(pose_of(self.truth).then(FORMATION).yaw_rad)


def looked_again(decisions: list[Decision]) -> bool:
    return any(decision.reason == "to see two faces" for decision in decisions)


def test_a_neighbour_that_drives_straight_ahead_is_not_checked() -> None:
    pair = Pair()
    assert not any(looked_again(pair.step(Motion(0.05), Motion(0.05))) for _ in range(10))


@pytest.mark.parametrize("turn_deg", [5.0, -5.0])
def test_the_heading_of_a_neighbour_that_turns_otherwise_than_forecast_is_found(turn_deg: float) -> None:
    pair, turn = Pair(), math.radians(turn_deg)
    forecast = Motion(0.05, 0.05 * math.tan(0.5 * turn), turn)
    made = Motion(0.05, 0.05 * math.tan(0.5 * turn), 1.5 * turn)  # on the spot by half of it, which no place shows
    checked = []
    for _ in range(6):
        decisions = pair.step(forecast, made)
        assert decisions[-1].verdict is Verdict.ALIGNED
        checked.append(looked_again(decisions))
        if checked[-1]:
            assert abs(pair.heading_deg) < 3.5
    assert 1 <= sum(checked) <= 3


def test_a_check_that_sees_the_neighbour_from_nowhere_else_ends_in_formation() -> None:
    def camera(state: Vector) -> list[Block]:
        return blocks_of(state) if abs(float(state[0])) < 0.06 else []

    pair, turn = Pair(camera), math.radians(8.0)
    for _ in range(6):
        decisions = pair.step(Motion(0.05, 0.05 * math.tan(0.5 * turn), turn), Motion(0.05, 0.0035, turn))
        assert decisions[-1].verdict in (Verdict.ALIGNED, Verdict.UNALIGNED)
    assert pair.heading_deg == pytest.approx(0.0, abs=8.0)


def test_a_check_that_takes_more_moves_than_there_are_is_left_out() -> None:
    pair = Pair(max_moves=1)
    turn = math.radians(8.0)
    for _ in range(4):
        decisions = pair.step(Motion(0.05, 0.0035, turn), Motion(0.05, 0.0035, turn))
        assert not looked_again(decisions)
        assert decisions[-1].verdict is Verdict.ALIGNED
