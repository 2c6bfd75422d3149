"""What is taken off moves to delayed places."""

import math

import pytest

from robot_formation.follower.actions import SendMove
from robot_formation.follower.actuation_error import MeanActuationError
from robot_formation.follower.fine_tuning import FineTuner, FineTunerParameters, Phase
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping
from robot_formation.schedule.schedules import Schedule, Spacing
from robot_formation.schedule.start_rule import StartRule
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

IN_PLACE = [Block(Face.TARGET, 158, 60, 49, 49, index=7)]
BEHIND = [Block(Face.TARGET, 200, 60, 49, 49, index=7)]
LEFT_M = 41.5 / 836.0
"""The way ahead that this picture shows, mode paper."""
COAST_M = 0.003


def learned(*moves: tuple[Motion, Motion]) -> MeanActuationError:
    mean = MeanActuationError()
    for commanded, error in moves:
        mean.learn(commanded, error)
    return mean


def test_a_constant_error_is_taken_off_to_the_end() -> None:
    mean = MeanActuationError()
    desired = Motion.from_legs(0.3, 0.05, 0.01)
    for _ in range(60):
        commanded = mean.compensated(desired)
        reached = Motion.from_legs(0.3, commanded.legs[1] + 0.004, commanded.legs[2] - 0.003)
        mean.learn(commanded, Motion(reached.x_m - commanded.x_m, reached.y_m - commanded.y_m))
    assert (reached.x_m, reached.y_m) == pytest.approx((desired.x_m, desired.y_m), abs=1e-6)
    assert commanded.yaw_rad == desired.yaw_rad


def test_the_first_moves_count_a_half_and_a_third() -> None:
    move = Motion(0.05), Motion(0.006)
    assert learned().compensated(Motion(0.05)) == Motion(0.05)
    assert learned(move).compensated(Motion(0.05)).x_m == pytest.approx(0.047)
    assert learned(move, move).compensated(Motion(0.05)).x_m == pytest.approx(0.046)


def test_moves_backwards_have_a_bias_of_their_own() -> None:
    mean = learned((Motion(0.05), Motion(0.004)), (Motion(-0.05), Motion(-0.002)))
    assert mean.compensated(Motion(0.05)).x_m == pytest.approx(0.048)
    assert mean.compensated(Motion(-0.05)).x_m == pytest.approx(-0.049)


@pytest.mark.parametrize(
    ("commanded", "error"),
    [
        (Motion(0.005), Motion(-0.004)),  # shorter than what is driven
        (Motion(0.05), Motion(-0.03)),  # braked
        (Motion(0.0, 0.05), Motion(0.0, -0.05)),  # refused
    ],
)
def test_moves_that_are_no_measure_of_coasting_teach_nothing(commanded: Motion, error: Motion) -> None:
    desired = Motion(0.04, 0.03, 0.1)
    assert learned((commanded, error)).compensated(desired) == learned().compensated(desired)


def test_moves_of_millimetres_are_commanded_as_they_are() -> None:
    desired = Motion(0.01, 0.01)
    assert learned((Motion(0.05), Motion(0.004))).compensated(desired) == desired
    assert math.hypot(desired.x_m, desired.y_m) < 0.02


@pytest.mark.parametrize(
    ("spacing", "expected"),
    [
        (Spacing.DELAYED, [0.0, LEFT_M, LEFT_M - COAST_M / 2, LEFT_M - COAST_M * 2 / 3]),
        (Spacing.RIGID, [0.05, 0.05 + COAST_M, 0.05 + 2 * COAST_M, 0.04]),  # known, twice the one before, predicted
    ],
)
def test_only_moves_to_a_delayed_place_are_compensated(spacing: Spacing, expected: list[float]) -> None:
    values = {"mode": "paper", "look": {"frames": 2, "stable_frames": 2}}
    schedule = Schedule.TOGETHER if spacing is Spacing.DELAYED else Schedule.TURNS
    tuner = FineTuner(from_mapping(FineTunerParameters, values, where="test"), StartRule(schedule, spacing))
    commands, stamps = [], iter(range(1, 1000))
    for timestep in range(5):
        for action in tuner.neighbour_done(timestep):
            if isinstance(action, SendMove):
                commands.append(action.motion.x_m)
                coasted_m = COAST_M if action.motion.x_m > 0.0 else 0.0
                tuner.moved(Motion(action.motion.x_m + coasted_m), next(stamps))
        seen = BEHIND if timestep and spacing is Spacing.DELAYED else IN_PLACE
        while tuner.phase is Phase.LOOK:
            tuner.frame(seen, next(stamps))
        tuner.prediction(Motion(0.04))
    assert commands == pytest.approx(expected)
