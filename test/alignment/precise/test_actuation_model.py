"""What a follower learns of its own drive: slip, overshoot, and legs that fall short."""

import math

import numpy as np
import pytest

from robot_formation.alignment.precise.actuation_model import (
    MOST_COMPENSATION_M,
    ActuationModel,
    ActuationParameters,
)
from robot_formation.alignment.precise.motion_planner import PlannerParameters, count_legs
from robot_formation.drive.movement_system import CalibrationParameters, DriveParameters
from robot_formation.geometry.se2 import Motion

P = ActuationParameters()


def legs_aside(aside_m: float, share: float, count: int) -> ActuationModel:
    """A model after so many legs aside of which the drive made a share."""
    actuation = ActuationModel(P)
    for _ in range(count):
        sent = actuation.compensated(Motion(0.0, aside_m))
        actuation.moved(sent, Motion(0.0, sent.y_m - (1.0 - share) * aside_m))
    return actuation


def test_a_drive_learns_its_slip_apart_from_legs_aside() -> None:
    actuation = ActuationModel(P)
    for aside_m in (0.0, -0.006, 0.004, 0.0, -0.008, 0.006) * 3:
        # It slips 3 cm per metre to the left, and legs aside come out 1.5 mm too far to the left.
        measured = aside_m + 0.03 * 0.05 + (0.0015 if aside_m else 0.0)
        actuation.moved(Motion(0.05, aside_m), Motion(0.05, measured))
    assert actuation.slip == pytest.approx(0.03, abs=0.003)
    assert actuation.overshoot == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("noise_m", [0.0002, 0.0007, 0.005])
def test_a_first_drive_counts_by_its_variance_against_that_of_the_slip(noise_m: float) -> None:
    actuation, length_m = ActuationModel(P, noise_m), 0.05
    actuation.moved(Motion(length_m), Motion(length_m, 0.03 * length_m))
    known, measured = (0.05 * length_m) ** 2, noise_m**2  # 0.05: the slip's standard deviation before any drive
    assert actuation.slip == pytest.approx(0.03 * known / (known + measured))


def test_drives_that_are_measured_without_error_can_be_learnt_from_again_and_again() -> None:
    actuation = ActuationModel(P, 0.0)
    for _ in range(50):
        actuation.moved(Motion(0.05), Motion(0.05, 0.03 * 0.05))
    assert actuation.slip == pytest.approx(0.03)


@pytest.mark.parametrize("aside_m", [0.0, 0.01, 0.019])
def test_after_thousands_of_drives_the_slip_is_still_learned(aside_m: float) -> None:
    model = ActuationModel(ActuationParameters())
    rng = np.random.default_rng(5)
    for number in range(3000):
        slip = 0.03 if number < 2900 else -0.02
        left_m = aside_m * math.sin(number * math.pi / 6)
        driven_m = left_m if abs(left_m) > ActuationParameters.least_leg_m else 0.0
        beside_m = driven_m + slip * 0.05 + rng.normal(scale=2e-4)
        model.moved(Motion(0.05, left_m, 0.0), Motion(0.05, beside_m, 0.0))
    assert model.slip == pytest.approx(-0.02, abs=0.005)
    assert np.array_equal(model._covariance, model._covariance.T)
    assert np.linalg.eigvalsh(model._covariance).min() > 0.0


def test_slip_and_overshoot_are_those_of_the_direction_after_the_turn() -> None:
    actuation, turn = ActuationModel(P), 0.4
    for _ in range(8):
        actuation.moved(Motion.from_legs(turn, 0.05, 0.0), Motion.from_legs(turn, 0.06, 0.0012))
    # The wheels' way in the turn counts too.
    assert actuation.slip == pytest.approx(0.0012 / (0.06 + P.wheel_lever_m * turn), abs=0.001)
    assert actuation.overshoot == pytest.approx(0.2)
    assert actuation.drives == 8


def test_the_first_overshoot_counts_whole_and_later_ones_by_their_share() -> None:
    actuation = ActuationModel(P)
    actuation.moved(Motion(0.05), Motion(0.06))
    assert actuation.overshoot == pytest.approx(0.2)
    actuation.moved(Motion(0.05), Motion(0.05))
    assert actuation.overshoot == pytest.approx(0.2 * 0.6)


@pytest.mark.parametrize(
    ("asked", "measured"),
    [
        (Motion(0.01), Motion(0.02)),  # too short
        (Motion(-0.05), Motion(-0.06)),  # back
        (Motion(0.05, 0.03), Motion(0.06, 0.03)),  # with a long leg aside
        (Motion(0.05), Motion(0.0)),  # blocked
    ],
)
def test_other_moves_teach_nothing_of_slip_and_overshoot(asked: Motion, measured: Motion) -> None:
    actuation = ActuationModel(P)
    actuation.moved(asked, measured)
    assert (actuation.drives, actuation.overshoot, actuation.slip) == (0, 0.0, 0.0)


def test_a_leg_aside_that_the_drive_only_coasts_counts_as_not_driven() -> None:
    found = []
    for aside_m in (0.9 * P.least_leg_m, 1.1 * P.least_leg_m):
        actuation = ActuationModel(P)
        for _ in range(6):
            actuation.moved(Motion(0.05, aside_m), Motion(0.05, 0.0))
        found.append(actuation.slip)
    assert found[0] == pytest.approx(0.0, abs=1e-12)
    assert found[1] < -0.01  # taken for a leg that slip has undone


def test_the_least_leg_is_what_the_default_drive_coasts() -> None:
    u = CalibrationParameters().u
    assert P.least_leg_m == pytest.approx(-u[0] / u[1], rel=0.01)


def test_a_short_leg_is_asked_for_longer_by_what_such_legs_fell_short() -> None:
    actuation = legs_aside(0.02, 0.9, 12)
    assert actuation.compensated(Motion(0.0, 0.02)).y_m == pytest.approx(0.022, abs=1e-5)
    assert actuation.compensated(Motion(0.0, -0.02)).y_m == -0.02  # the other direction has its own mean
    assert actuation.compensated(Motion(0.02)).x_m == 0.02  # and so has the other axis
    assert actuation.compensated(Motion(0.0, 0.08)).y_m == 0.08  # long legs stay


def test_legs_are_made_longer_by_no_more_than_the_bound_and_never_shorter() -> None:
    assert legs_aside(0.05, 0.2, 10).compensated(Motion(0.0, 0.05)).y_m == pytest.approx(0.05 + MOST_COMPENSATION_M)
    assert legs_aside(0.05, 1.5, 10).compensated(Motion(0.0, 0.05)).y_m == 0.05


def test_what_is_learned_of_short_legs_adds_no_leg_that_was_not_asked_for() -> None:
    actuation, turned = ActuationModel(P), math.radians(4.3)
    for aside_m in (0.01, -0.01) * 3:
        actuation.compensated(Motion(0.0, aside_m))
        actuation.moved(Motion(0.0, aside_m), Motion(0.0, 0.5 * aside_m))
    for ahead_m in np.linspace(-0.19, 0.19, 21).tolist():
        asked = Motion(ahead_m * math.cos(turned), ahead_m * math.sin(turned), turned)
        assert count_legs(actuation.compensated(asked)) == count_legs(asked)


def test_no_leg_that_the_planner_may_choose_is_made_longer_than_the_drive_takes() -> None:
    planner, drive = PlannerParameters(), DriveParameters()
    ahead = ActuationModel(P)
    for length_m in (0.03, -0.03) * 20:
        ahead.compensated(Motion(length_m))
        ahead.moved(Motion(length_m), Motion())
        ahead.compensated(Motion(0.0, length_m))
        ahead.moved(Motion(0.0, length_m), Motion())
    for share in np.linspace(-1.0, 1.0, 401).tolist():
        sent = ahead.compensated(Motion(share * planner.max_v_m, share * planner.max_u_m))
        assert abs(sent.x_m) <= drive.max_v_m
        assert abs(sent.y_m) <= drive.max_u_m
