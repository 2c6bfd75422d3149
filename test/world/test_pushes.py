"""Pushes: where a robot stands afterwards, what its encoders say, and which pushes are refused."""

import math

import pytest

from robot_formation.parameters import ParameterError
from robot_formation.world.checks import WorldError
from robot_formation.world.events import JointStates, RobotPose
from robot_formation.world.pushes import Push, check_push, read_push
from world_helpers import IDEAL, SPEEDS, STRAIGHT, displacement, of_kind, run, world

ROBOT = "follower_1"


@pytest.mark.parametrize("surface", ["plane", "bowl", "saddle"])
def test_a_pushed_robot_is_displaced_in_its_own_frame_and_nothing_tells_it(surface: str) -> None:
    a_world = world(surface)
    before, joints = a_world.ground_truth(ROBOT), a_world.joint_states(ROBOT)
    a_world.push(Push(ROBOT, 1, 0.03, -0.02))
    forward, left, turn = displacement(a_world, ROBOT, before)
    assert (forward, left) == pytest.approx((0.03, -0.02))
    assert turn == pytest.approx(0.0, abs=1e-6)
    assert a_world.joint_states(ROBOT) == joints
    assert not a_world.owes
    assert a_world.ground_truth("leader").pose == world(surface).ground_truth("leader").pose


def test_a_pushed_robot_stands_on_the_ground() -> None:
    """A hold, of which the body takes part in the physics, hardly moves it: the wheels carry it as they did."""
    a_world = world("bowl", **IDEAL)
    a_world.push(Push(ROBOT, 1, 0.03, 0.03))
    before = a_world.ground_truth(ROBOT)
    a_world.command(ROBOT, STRAIGHT, SPEEDS)
    a_world.command(ROBOT, (0.0,) * 4, (0.0,) * 4)
    run(a_world)
    forward, left, turn = displacement(a_world, ROBOT, before)
    assert math.hypot(forward, left) < 0.0005
    assert abs(turn) < 0.002
    assert abs(a_world.ground_truth(ROBOT).z_m - before.z_m) < 0.0005


def test_a_robot_that_is_pushed_while_it_moves_goes_on() -> None:
    ends = []
    for pushed in (False, True):
        a_world = world(**IDEAL)
        start = a_world.ground_truth(ROBOT)
        a_world.command(ROBOT, STRAIGHT, SPEEDS)
        for _ in range(5):
            a_world.advance()
        if pushed:
            speed = a_world.ground_truth(ROBOT).linear_m_s
            a_world.push(Push(ROBOT, 1, 0.03, 0.0))
            assert a_world.ground_truth(ROBOT).linear_m_s == pytest.approx(speed)
        events = run(a_world)
        assert of_kind(events, RobotPose)[-1].final
        ends.append((displacement(a_world, ROBOT, start)[0], of_kind(events, JointStates)[-1].positions[4]))
    (way, wheel), (pushed_way, pushed_wheel) = ends
    assert pushed_way - way == pytest.approx(0.03, abs=0.0005)
    assert pushed_wheel == pytest.approx(wheel, abs=0.02)


def test_a_robot_is_not_pushed_into_another_one_or_off_the_plate() -> None:
    a_world = world()
    before = a_world.ground_truth(ROBOT)
    with pytest.raises(WorldError, match="would stand in another robot"):
        a_world.push(Push(ROBOT, 1, 0.0, 0.1))
    assert a_world.ground_truth(ROBOT).pose.position == pytest.approx(before.pose.position)
    for _ in range(3):
        a_world.push(Push(ROBOT, 1, -0.09, 0.0))
    with pytest.raises(WorldError, match="beyond the plate's edge"):
        a_world.push(Push(ROBOT, 1, -0.09, 0.0))


@pytest.mark.parametrize("x_m", [0.03, -0.1, 1e-17])
def test_a_push_is_read_back_from_its_text(x_m: float) -> None:
    push = Push("follower_2", 8, x_m, 0.0)
    assert read_push(push.text) == push


@pytest.mark.parametrize(
    "text", ["", "follower_2", "follower_2 8 0.03", "follower_2 8 0.03 0 0", "follower_2 8.5 0.03 0", "a b c d",
             "follower_2 8 nan 0", "follower_2 8 0.2 0"]
)  # fmt: skip
def test_a_text_that_is_no_push_is_refused(text: str) -> None:
    with pytest.raises(ParameterError, match="world: 'pushes'"):
        read_push(text)


@pytest.mark.parametrize(("robot", "timestep", "words"), [("follower_3", 1, "no robot"), ("leader", 0, "outside 1")])
def test_a_push_that_can_not_happen_is_refused(robot: str, timestep: int, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        check_push(Push(robot, timestep, 0.0, 0.0), ("leader", "follower_1"), 20)
