"""The leader on messages: bare ticks in and out, a step of its path in between."""

import math
from typing import Any

import pytest
from geometry_msgs.msg import Twist, TwistStamped

from component_helpers import wired
from robot_formation import conversions
from robot_formation.geometry.se2 import Motion

DONE = "/formation/leader/done"


def tick(number: int) -> Any:
    return conversions.uint32(number)


def moved(stamp_ns: int) -> Any:
    return conversions.displacement(Motion(0.05), "leader/base_link", stamp_ns)


def test_a_tour_on_messages() -> None:
    wire = wired("leader", "leader", timesteps=2, step_m=0.04)
    wire.component.start()
    assert [topic for topic, _ in wire.sent] == ["plan", DONE]
    assert wire.sent[-1][1].data == 0
    for timestep in (1, 2):
        ((topic, message),) = wire.give("/formation/follower_1/done", tick(timestep - 1))
        assert topic == "move"
        assert conversions.read_move(message) == Motion(x_m=0.04)
        assert message.header.frame_id == "leader/base_link"
        ((topic, message),) = wire.give("moved", moved(timestep * 100))
        assert (topic, message.data) == (DONE, timestep)
        assert wire.component.stamp_ns == timestep * 100
    before = wire.component.exit_code
    assert before is None
    assert wire.give("/formation/follower_1/done", tick(2)) == []
    assert (wire.component.exit_code, wire.component.exit_reason) == (0, "all 2 timesteps driven")


def test_every_follower_is_waited_for() -> None:
    wire = wired("leader", "leader", followers=["follower_1", "follower_2"])
    wire.component.start()
    assert wire.give("/formation/follower_2/done", tick(0)) == []
    assert wire.component.details()["waiting for"] == "follower_1"
    assert [topic for topic, _ in wire.give("/formation/follower_1/done", tick(0))] == ["move"]


def test_stop_lets_the_step_end_and_start_goes_on() -> None:
    wire = wired("leader", "leader", timesteps=5)
    services = wire.component.services()
    wire.component.start()
    assert services["stop"]()[0]
    assert wire.give("/formation/follower_1/done", tick(0)) == []
    success, text = services["start"]()
    assert success
    assert "timestep 1" in text
    assert wire.sent[-1][0] == "move"


def test_a_moved_that_nobody_asked_for_sends_no_tick() -> None:
    wire = wired("leader", "leader")
    wire.component.start()
    assert wire.give("moved", moved(5)) == []


def test_the_plan_is_shown_from_the_start_on_in_the_leaders_own_frame() -> None:
    wire = wired("leader", "leader", timesteps=3, path="circle", path_parameters=["period=4", "heading=along"])
    wire.component.start()
    plan = wire.sent[0][1]
    assert plan.header.frame_id == "leader/odom"
    found = [conversions.read_pose(stamped.pose) for stamped in plan.poses]
    assert [round(pose.yaw_rad, 6) for pose in found] == [0.0, 1.570796, 3.141593, -1.570796]
    assert (found[2].x_m, found[2].y_m) == pytest.approx((0.0, 0.05 * math.sqrt(2.0)))


def test_the_plan_of_a_long_path_is_thinned_out_to_its_end() -> None:
    wire = wired("leader", "leader", timesteps=5000, step_m=0.001)
    wire.component.start()
    places = [stamped.pose.position.x for stamped in wire.sent[0][1].poses]
    assert len(places) <= 2001
    assert places[-1] == pytest.approx(5.0)


def twist(ahead: float, left: float = 0.0, turn: float = 0.0) -> Any:
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = ahead, left, turn
    return message


def driven() -> tuple[Any, list[float]]:
    """A leader that a person drives, and the wall time that it reads."""
    wire, now = wired("leader", "leader", timesteps=2, path="teleop"), [100.0]
    wire.component.wall_clock = lambda: now[0]
    wire.component.start()
    return wire, now


def test_a_person_drives_the_leader_once_all_are_ready() -> None:
    wire, now = driven()
    assert [topic for topic, _ in wire.sent] == [DONE]  # nobody knows the way beforehand
    assert wire.give("cmd_vel_unstamped", twist(0.05)) == []
    now[0] += 0.3
    ((topic, message),) = wire.give("/formation/follower_1/done", tick(0))
    assert (topic, conversions.read_move(message)) == ("move", Motion(0.05))
    assert wire.give("cmd_vel_unstamped", twist(0.02)) == []  # the step is under way
    wire.give("moved", moved(100))
    now[0] += 1.0
    assert wire.give("/formation/follower_1/done", tick(1)) == []  # let go of
    ((topic, message),) = wire.give("cmd_vel", TwistStamped(twist=twist(0.0, 0.02, 0.1)))
    motion = conversions.read_move(message)
    assert (topic, motion.x_m, motion.y_m) == ("move", -0.000999, 0.019967)
    assert motion.yaw_rad == pytest.approx(0.1)


def test_a_velocity_that_is_not_finite_moves_nobody() -> None:
    wire, _ = driven()
    wire.give("/formation/follower_1/done", tick(0))
    assert wire.give("cmd_vel_unstamped", twist(math.nan)) == []
    assert wire.warnings == ["a velocity that is not finite is ignored"]


def test_only_a_leader_that_is_driven_listens_to_velocities() -> None:
    assert not {"cmd_vel", "cmd_vel_unstamped"} & set(wired("leader", "leader").inputs)
