"""The drive turns distances into wheel rotations and encoder counts into displacements, one move at a time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.drive.movement_system import (
    CalibrationParameters,
    Drive,
    DriveAction,
    DriveParameters,
    WheelCommand,
)
from robot_formation.geometry.se2 import Motion
from robot_formation.names import JOINTS
from robot_formation.parameters import from_mapping

P = DriveParameters()
REST = (0.0,) * 6
TURNING = (1.0,) + (0.0,) * 5


def driven(action: DriveAction) -> Motion:
    """The displacement that ends a move."""
    assert action.moved is not None
    return action.moved


def angles_of(action: DriveAction) -> tuple[float, ...]:
    """Wheel angles of the command."""
    assert action.command is not None
    return action.command.angles_rad


def linear(**values: float) -> DriveParameters:
    """A drive whose rotations are the ideal kinematics: no slip, no coasting."""
    r = P.wheel_radius_m
    return from_mapping(
        DriveParameters,
        {"calibration": {"v": [0.0, 1 / r], "u": [0.0, 1 / r], "turn": [0.0, P.wheel_lever_m / r]}, **values},
        where="test",
    )


def inverse_kinematics(x: float, y: float, yaw: float) -> tuple[float, ...]:
    """Mecanum wheels with rollers in X: wheel angles (FL, FR, RL, RR) of a small body motion, by the closed form."""
    turn = P.wheel_lever_m * yaw
    return tuple(a / P.wheel_radius_m for a in (x - y - turn, x + y + turn, x + y - turn, x - y + turn))


def joints(x: float, y: float, yaw: float) -> tuple[float, ...]:
    """Angles of all six joints after a rigid motion at constant rates; sensing wheels measure at their own places."""
    v_wheel = x - yaw * P.encoder_v_offset_m
    u_wheel = y + yaw * P.encoder_u_offset_m
    return (*inverse_kinematics(x, y, yaw), v_wheel / P.encoder_radius_m, u_wheel / P.encoder_radius_m)


def plus(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(p + q for p, q in zip(a, b, strict=True))


def commands_of(drive: Drive, target: Motion) -> tuple[list[WheelCommand], DriveAction]:
    """Every command of a move, each leg answered by a rest report."""
    action = drive.move(target)
    found = []
    while action.command is not None:
        found.append(action.command)
        action = drive.joint_states(0, REST, REST)
    return found, action


@pytest.mark.parametrize(
    ("motion", "signs"),
    [
        (Motion.from_uv(0.0, 0.05), (1, 1, 1, 1)),
        (Motion.from_uv(0.0, -0.05), (-1, -1, -1, -1)),
        (Motion.from_uv(0.05, 0.0), (1, -1, -1, 1)),
        (Motion.from_uv(-0.05, 0.0), (-1, 1, 1, -1)),
        (Motion(yaw_rad=0.1), (-1, 1, -1, 1)),
        (Motion(yaw_rad=-0.1), (1, -1, 1, -1)),
    ],
    ids=["v forward", "v back", "u right", "u left", "turn left", "turn right"],
)
def test_each_axis_turns_the_wheels_by_closed_form_mecanum_kinematics(
    motion: Motion, signs: tuple[int, int, int, int]
) -> None:
    (command,), _ = commands_of(Drive(linear()), motion)
    expected = inverse_kinematics(motion.x_m, motion.y_m, motion.yaw_rad)
    assert command is not None
    assert command.angles_rad == pytest.approx(expected, rel=1e-12)
    assert [math.copysign(1, angle) for angle in command.angles_rad] == list(signs)
    assert command.limits_rad_s == (P.wheel_speed_rad_s,) * 4


@given(v=st.floats(0.01, 0.2), sign=st.sampled_from([-1.0, 1.0]))
def test_the_calibration_curve_is_a_polynomial_of_the_distance_odd_in_its_sign(v: float, sign: float) -> None:
    curve = (-0.1, 30.0, 12.0, -5.0)
    drive = Drive(DriveParameters(calibration=CalibrationParameters(v=curve)))
    (command,), _ = commands_of(drive, Motion(x_m=sign * v))
    expected = sign * (-0.1 + 30.0 * v + 12.0 * v**2 - 5.0 * v**3)
    assert command is not None
    assert command.angles_rad == pytest.approx((expected,) * 4, rel=1e-12)


def test_a_distance_shorter_than_the_coasting_holds_instead_of_driving_backwards() -> None:
    drive = Drive(DriveParameters(calibration=CalibrationParameters(v=(-0.1, 30.0))))
    action = drive.move(Motion(x_m=0.003))
    assert angles_of(action) == (0.0,) * 4
    assert action.warning == ""
    assert drive.joint_states(0, REST, REST).moved == Motion()


def test_no_distance_at_all_is_a_hold_that_is_answered_too() -> None:
    commands, last = commands_of(Drive(P), Motion())
    assert [command.angles_rad for command in commands] == [(0.0,) * 4]
    assert last.moved == Motion()


micro = st.integers(-60_000, 60_000).map(lambda count: count * 1e-6)


@given(x=micro, y=micro, yaw=st.floats(-1.0, 1.0, allow_subnormal=False))
def test_turn_then_v_then_u_lead_to_the_target(x: float, y: float, yaw: float) -> None:
    target = Motion(x, y, yaw)
    reached = Motion()
    order = []
    for command in commands_of(Drive(linear()), target)[0]:
        fl, fr, rl, _ = (P.wheel_radius_m * angle for angle in command.angles_rad)
        if (fl > 0.0) == (fr > 0.0):  # v: all wheels alike
            leg, axis = Motion(x_m=fl), 1
        elif (fr > 0.0) == (rl > 0.0):  # u: diagonals alike
            leg, axis = Motion(y_m=fr), 2
        else:
            leg, axis = Motion(yaw_rad=fr / P.wheel_lever_m), 0
        order.append(axis)
        reached = reached.then(leg)
    assert order == sorted(set(order))
    assert (reached.x_m, reached.y_m, reached.yaw_rad) == pytest.approx((x, y, yaw), abs=1e-12)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (Motion(x_m=0.2001), "0.200 in v: beyond the calibrated range of 0.2"),
        (Motion(x_m=-0.25), "0.250 in v"),
        (Motion(y_m=0.11), "0.110 in u"),
        (Motion(y_m=-0.11), "0.110 in u"),
        (Motion(yaw_rad=1.2), "1.200 in turn"),
        (Motion(yaw_rad=-1.2), "1.200 in turn"),
        (Motion(x_m=math.nan), "not finite"),
        (Motion(y_m=math.inf), "not finite"),
        (Motion(yaw_rad=math.nan), "not finite"),
    ],
)
def test_a_move_that_cannot_be_driven_holds_with_a_warning_and_is_answered(motion: Motion, words: str) -> None:
    drive = Drive(P)
    action = drive.move(motion)
    assert words in action.warning
    assert angles_of(action) == (0.0,) * 4
    assert drive.busy
    assert drive.joint_states(0, REST, REST) == DriveAction(moved=Motion())
    assert not drive.busy


@pytest.mark.parametrize("motion", [Motion(x_m=0.2), Motion(y_m=-0.1), Motion(yaw_rad=1.1)])
def test_the_ends_of_the_calibrated_range_are_driven(motion: Motion) -> None:
    action = Drive(P).move(motion)
    assert action.warning == ""
    assert any(angles_of(action))


def test_the_range_holds_for_the_legs_not_for_the_target_in_the_old_frame() -> None:
    # 20 cm forward after a turn of 1 rad is 17 cm to the right of the new heading: beyond u's range.
    assert "0.168 in u" in Drive(P).move(Motion(0.2, 0.0, 1.0)).warning
    # 15 cm to the left after a turn of 1 rad is mostly forward.
    assert Drive(P).move(Motion(0.0, 0.15, 1.0)).warning == ""


@given(x=st.floats(-0.2, 0.2), y=st.floats(-0.1, 0.1))
def test_a_translation_is_measured_exactly(x: float, y: float) -> None:
    drive = Drive(P)
    drive.move(Motion(x_m=0.1))
    moved = driven(drive.joint_states(0, joints(x, y, 0.0), REST))
    assert (moved.x_m, moved.y_m, moved.yaw_rad) == pytest.approx((x, y, 0.0), abs=1e-15)


@given(yaw=st.floats(-1.0, 1.0))
def test_a_turn_on_the_spot_moves_the_offset_sensing_wheels_but_not_the_robot(yaw: float) -> None:
    drive = Drive(P)
    drive.move(Motion(yaw_rad=0.5))
    after = joints(0.0, 0.0, yaw)
    moved = driven(drive.joint_states(0, after, REST))
    assert (moved.x_m, moved.y_m, moved.yaw_rad) == pytest.approx((0.0, 0.0, yaw), abs=1e-15)
    # Left turn: the v wheel, 3 cm to the right of the centre, rolls forward; the u wheel, 5 cm behind it, to the right.
    assert after[4] * yaw >= 0.0 >= after[5] * yaw


@given(x=st.floats(-0.1, 0.1), y=st.floats(-0.1, 0.1), yaw=st.floats(-0.1, 0.1))
def test_a_slightly_curved_leg_is_measured_to_the_second_order_of_its_turn(x: float, y: float, yaw: float) -> None:
    # Constant rates along the body's axes make an arc; its chord is turned by half the yaw.
    drive = Drive(P)
    drive.move(Motion(x_m=0.1))
    moved = driven(drive.joint_states(0, joints(x, y, yaw), REST))
    straight, half = (1.0, 0.0) if yaw == 0.0 else (math.sin(yaw) / yaw, (1 - math.cos(yaw)) / yaw)
    truth = (straight * x - half * y, half * x + straight * y)
    assert math.dist((moved.x_m, moved.y_m), truth) <= 0.51 * abs(yaw) * math.hypot(x, y) + 1e-15
    assert moved.yaw_rad == pytest.approx(yaw, abs=1e-15)


def test_legs_compose_into_the_displacement_in_the_frame_at_the_start() -> None:
    drive = Drive(P)
    assert drive.move(Motion(x_m=0.0, y_m=0.05, yaw_rad=math.pi / 4)).command is not None
    position = joints(0.0, 0.0, math.pi / 4)
    assert drive.joint_states(1, position, REST).command is not None
    position = plus(position, joints(0.05, 0.0, 0.0))
    assert drive.joint_states(2, position, REST).command is not None
    position = plus(position, joints(0.0, 0.02, 0.0))
    moved = driven(drive.joint_states(3, position, REST))
    expected = Motion(yaw_rad=math.pi / 4).then(Motion(0.05, 0.02))
    assert (moved.x_m, moved.y_m, moved.yaw_rad) == pytest.approx(
        (expected.x_m, expected.y_m, expected.yaw_rad), abs=1e-15
    )


def test_odometry_is_the_composition_of_all_moves() -> None:
    drive = Drive(P)
    position: tuple[float, ...] = (0.0,) * 6
    expected = Motion()
    for leg in (Motion(0.05, 0.0, 0.0), Motion(0.0, 0.0, 0.5), Motion(0.05, 0.0, 0.0)):
        drive.move(leg)
        position = plus(position, joints(leg.x_m, leg.y_m, leg.yaw_rad))
        assert drive.joint_states(0, position, REST).moved is not None
        expected = expected.then(leg)
    found = drive.odometry
    assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx((expected.x_m, expected.y_m, expected.yaw_rad))


def test_a_leg_is_over_only_when_every_joint_stands() -> None:
    drive = Drive(P)
    drive.move(Motion(x_m=0.05))
    for joint in range(6):
        velocities = tuple(1e-9 if i == joint else 0.0 for i in range(6))
        assert drive.joint_states(joint, joints(0.01, 0.0, 0.0), velocities) == DriveAction()
    assert driven(drive.joint_states(9, joints(0.05, 0.0, 0.0), REST)).x_m == pytest.approx(0.05)


def test_unsolicited_joint_states_are_not_part_of_the_next_displacement() -> None:
    drive = Drive(P)
    assert drive.joint_states(0, joints(0.3, 0.2, 0.1), REST) == DriveAction()
    drive.move(Motion(x_m=0.05))
    moved = driven(drive.joint_states(1, plus(joints(0.3, 0.2, 0.1), joints(0.05, 0.0, 0.0)), REST))
    assert (moved.x_m, moved.y_m, moved.yaw_rad) == pytest.approx((0.05, 0.0, 0.0), abs=1e-14)
    assert drive.odometry == moved


def test_a_second_move_while_busy_is_dropped_and_the_first_goes_on() -> None:
    drive = Drive(P)
    drive.move(Motion(x_m=0.05))
    action = drive.move(Motion(x_m=-0.05))
    assert action.command is None
    assert "under way" in action.warning
    assert driven(drive.joint_states(0, joints(0.05, 0.0, 0.0), REST)).x_m == pytest.approx(0.05)
    assert not drive.busy


def test_a_stop_brakes_gives_up_the_other_legs_and_reports_what_was_driven() -> None:
    drive = Drive(P)
    drive.move(Motion(0.1, 0.05))
    action = drive.stop()
    assert angles_of(action) == (0.0,) * 4
    assert drive.busy
    assert drive.joint_states(0, joints(0.02, 0.0, 0.0), TURNING) == DriveAction()
    last = drive.joint_states(1, joints(0.03, 0.0, 0.0), REST)
    assert last.command is None
    assert driven(last).x_m == pytest.approx(0.03)
    assert not drive.busy


def test_a_stop_of_a_standing_robot_only_says_so() -> None:
    action = Drive(P).stop()
    assert action.command is None
    assert "nothing to stop" in action.warning


def test_a_leg_that_takes_too_long_is_stopped_once_and_still_answered() -> None:
    drive = Drive(linear(move_timeout_s=2.0))
    drive.move(Motion(0.1, 0.05))
    second = 10**9
    assert drive.joint_states(5 * second, joints(0.01, 0.0, 0.0), TURNING) == DriveAction()
    assert drive.joint_states(7 * second - 1, joints(0.02, 0.0, 0.0), TURNING) == DriveAction()
    action = drive.joint_states(7 * second, joints(0.03, 0.0, 0.0), TURNING)
    assert "longer than 2.0 s" in action.warning
    assert angles_of(action) == (0.0,) * 4
    assert drive.joint_states(9 * second, joints(0.03, 0.0, 0.0), TURNING) == DriveAction()
    assert driven(drive.joint_states(10 * second, joints(0.03, 0.0, 0.0), REST)).x_m == pytest.approx(0.03)


def test_every_leg_has_the_whole_timeout() -> None:
    drive = Drive(linear(move_timeout_s=2.0))
    drive.move(Motion(0.1, 0.05))
    second = 10**9
    drive.joint_states(0, joints(0.01, 0.0, 0.0), TURNING)
    assert drive.joint_states(int(1.9 * second), joints(0.1, 0.0, 0.0), REST).command is not None
    assert drive.joint_states(int(1.9 * second), joints(0.1, 0.0, 0.0), TURNING) == DriveAction()
    assert drive.joint_states(int(3.8 * second), joints(0.1, 0.01, 0.0), TURNING) == DriveAction()


def test_joints_are_named_once_each() -> None:
    assert len(set(JOINTS)) == len(JOINTS) == 6
