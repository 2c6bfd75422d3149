"""The drive on messages: moves in, wheel commands out, joint states in, displacements out."""

import math
from collections.abc import Sequence
from typing import Any

import pytest

from component_helpers import Wire, wired
from robot_formation import conversions
from robot_formation.drive.curves import CalibrationError
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.names import JOINTS
from robot_formation.parameters import ParameterError

R, E = 0.03, 0.019  # radii of drive and encoder wheels


def states(
    positions: Sequence[float] = (0.0,) * 6,
    velocities: Sequence[float] = (0.0,) * 6,
    stamp_ns: int = 0,
    names: Sequence[str] = JOINTS,
) -> Any:
    return conversions.joint_states(names, positions, velocities, stamp_ns)


def move(motion: Motion, stamp_ns: int = 0) -> Any:
    return conversions.move(motion, "leader/base_link", stamp_ns)


@pytest.fixture
def wire() -> Wire:
    return wired("drive", "leader")


def test_a_move_becomes_a_command_and_its_end_odometry_and_moved_with_the_stamp_of_the_end(wire: Wire) -> None:
    ((topic, message),) = wire.give("move", move(Motion(0.05), 100))
    assert topic == "joint_commands"
    assert conversions.read_joint_command(message).angles_rad == pytest.approx((-0.084 + 33.3257 * 0.05,) * 4)
    assert conversions.stamp_of(message) == 100
    assert wire.give("joint_states", states((1, 1, 1, 1, 1, 0), (1.0,) * 6, 200)) == []
    sent = wire.give("joint_states", states((1.6, 1.6, 1.6, 1.6, 0.05 / E, 0.002 / E), stamp_ns=300))
    assert [topic for topic, _ in sent] == ["odom", "moved"]
    odom, moved = (message for _, message in sent)
    assert (odom.header.frame_id, odom.child_frame_id) == ("leader/odom", "leader/base_link")
    assert moved.header.frame_id == "leader/base_link"
    assert conversions.stamp_of(moved) == conversions.stamp_of(odom) == 300
    found = conversions.read_displacement(moved)
    assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx((0.05, 0.002, 0.0))
    assert conversions.has_estimate(moved)
    assert math.sqrt(moved.pose.covariance[0]) == pytest.approx(0.0002)
    assert wire.warnings == []


def test_odometry_goes_on_while_moved_starts_anew(wire: Wire) -> None:
    for number in (1, 2, 3):
        wire.give("move", move(Motion(0.05)))
        sent = dict(wire.give("joint_states", states((0, 0, 0, 0, number * 0.05 / E, 0), stamp_ns=number)))
        assert sent["odom"].pose.pose.position.x == pytest.approx(0.05 * number)
        assert sent["moved"].pose.pose.position.x == pytest.approx(0.05)


@pytest.mark.parametrize("motion", [Motion(0.3), Motion(math.nan), Motion(0.0, math.inf), Motion(yaw_rad=math.nan)])
def test_a_move_that_cannot_be_driven_warns_commands_a_hold_and_is_answered(wire: Wire, motion: Motion) -> None:
    ((topic, message),) = wire.give("move", move(motion))
    assert topic == "joint_commands"
    assert conversions.read_joint_command(message).angles_rad == (0.0,) * 4
    assert len(wire.warnings) == 1
    assert dict(wire.give("joint_states", states()))["moved"].pose.pose.position.x == 0.0


@pytest.mark.parametrize(
    "bad",
    [
        states((math.nan,) + (0.0,) * 5),
        states(velocities=(math.inf,) + (0.0,) * 5),
        states((0.0,) * 5, (0.0,) * 5, names=JOINTS[:5]),
        states((), ()),
    ],
    ids=["nan", "inf", "a joint missing", "empty"],
)
def test_bad_joint_states_warn_and_change_nothing(wire: Wire, bad: Any) -> None:
    wire.give("move", move(Motion(0.05)))
    stamp = wire.component.stamp_ns
    assert wire.give("joint_states", bad) == []
    assert len(wire.warnings) == 1
    assert wire.component.stamp_ns == stamp
    assert wire.component.details()["moving"] == "True"
    sent = dict(wire.give("joint_states", states((0, 0, 0, 0, 0.05 / E, 0), stamp_ns=9)))
    assert sent["moved"].pose.pose.position.x == pytest.approx(0.05)


def test_a_second_move_is_dropped_with_a_warning(wire: Wire) -> None:
    wire.give("move", move(Motion(0.05)))
    assert wire.give("move", move(Motion(0.1))) == []
    assert "under way" in wire.warnings[0]


def test_the_stop_service_brakes_and_says_whether_there_was_anything_to_stop(wire: Wire) -> None:
    stop = wire.component.services()["drive/stop"]
    success, text = stop()
    assert not success
    assert "nothing to stop" in text
    wire.give("move", move(Motion(0.05)))
    assert stop() == (True, "stopped on request")
    assert conversions.read_joint_command(wire.sent[-1][1]).angles_rad == (0.0,) * 4
    assert [topic for topic, _ in wire.give("joint_states", states())] == ["odom", "moved"]


def test_parameters_are_taken_between_moves_and_odometry_and_joints_go_on(wire: Wire) -> None:
    set_parameters = wire.component.set_parameters
    wire.give("move", move(Motion(0.05)))
    with pytest.raises(ParameterError, match="after 'moved'"):
        set_parameters(DriveParameters(wheel_speed_rad_s=2.0))
    wire.give("joint_states", states((0, 0, 0, 0, 0.05 / E, 0), stamp_ns=1))
    set_parameters(DriveParameters(wheel_speed_rad_s=2.0, max_v_m=0.06))
    ((_, command),) = wire.give("move", move(Motion(0.05)))
    assert conversions.read_joint_command(command).limits_rad_s == (2.0,) * 4
    sent = dict(wire.give("joint_states", states((0, 0, 0, 0, 0.1 / E, 0), stamp_ns=2)))
    assert sent["moved"].pose.pose.position.x == pytest.approx(0.05)
    assert sent["odom"].pose.pose.position.x == pytest.approx(0.1)
    wire.give("move", move(Motion(0.07)))
    assert "beyond the calibrated range of 0.06" in wire.warnings[-1]


def test_a_calibration_file_that_cannot_be_used_changes_nothing(wire: Wire) -> None:
    with pytest.raises(CalibrationError, match="missing"):
        wire.component.set_parameters(DriveParameters(calibration_file="missing.yaml"))
    assert wire.component.details()["calibration"] == "by parameters"
