import math
from typing import Any

import numpy as np
import pytest

from robot_formation.parameters import ParameterError
from robot_formation.world.checks import WorldError
from robot_formation.world.events import BodyState, Frame, JointStates, RobotPose
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World
from world_helpers import PAIR, SPEEDS, STRAIGHT, of_kind, parameters, run, world

HOLD = (0.0,) * 4


def test_time_stands_still_while_nothing_is_owed() -> None:
    a_world = world()
    assert not a_world.owes
    assert a_world.advance() == []
    assert a_world.step_count == 0


def test_time_stops_on_the_step_of_the_final_joint_states() -> None:
    a_world = world()
    a_world.command("leader", STRAIGHT, SPEEDS)
    assert a_world.owes
    final = of_kind(run(a_world), JointStates)[-1]
    assert final.stamp_ns == a_world.stamp_ns
    assert a_world.advance() == []


def test_a_hold_takes_one_step() -> None:
    a_world = world()
    a_world.command("leader", HOLD, HOLD)
    final = of_kind(run(a_world), JointStates)
    assert [state.final for state in final] == [True]
    assert a_world.step_count == 1


def test_stream_gives_a_frame_at_every_tick_while_a_robot_moves() -> None:
    a_world = world()
    a_world.command("leader", STRAIGHT, SPEEDS)
    frames = of_kind(run(a_world), Frame)
    assert {frame.robot for frame in frames} == {"follower_1"}
    assert len(frames) == a_world.step_count // 8
    assert [frame.stamp_ns for frame in frames] == [8 * (i + 1) * 10**9 // 240 for i in range(len(frames))]


def test_on_demand_gives_only_the_requested_frames() -> None:
    a_world = world(camera={"mode": "on_demand"})
    a_world.command("leader", STRAIGHT, SPEEDS)
    assert of_kind(run(a_world), Frame) == []
    asked = a_world.stamp_ns
    a_world.request_frames("follower_1", 3)
    a_world.request_frames("follower_1", 2)
    frames = of_kind(run(a_world), Frame)
    assert len(frames) == 5
    assert frames[0].stamp_ns > asked
    assert frames[-1].stamp_ns == a_world.stamp_ns


@pytest.mark.parametrize("mode", ["stream", "on_demand"])
def test_requested_frames_are_stamped_later_than_the_request(mode: str) -> None:
    a_world = world(camera={"mode": mode})
    for _ in range(3):
        asked = a_world.stamp_ns
        a_world.request_frames("follower_1", 1)
        (frame,) = of_kind(run(a_world), Frame)
        assert frame.stamp_ns > asked
        assert frame.image.shape == (208, 316, 3)
        assert frame.image.dtype == np.uint8


def test_lockstep_robots_start_together_and_a_hold_counts() -> None:
    a_world = world(lockstep=["leader", "follower_1"])
    a_world.command("leader", STRAIGHT, SPEEDS)
    assert a_world.advance() == []
    a_world.command("follower_1", HOLD, HOLD)
    events = run(a_world)
    assert {event.robot for event in of_kind(events, JointStates) if event.final} == {"leader", "follower_1"}


@pytest.mark.parametrize(
    ("angles", "speeds", "says"),
    [
        ((1.0, 1.0, 1.0), SPEEDS, "four wheel angles"),
        ((1.0, math.nan, 1.0, 1.0), SPEEDS, "finite"),
        (STRAIGHT, (4.0, 4.0, math.inf, 4.0), "finite"),
        (STRAIGHT, (0.0,) * 4, "more than 0"),
        (STRAIGHT, (12.5,) * 4, "at most 12 rad/s"),
        ((1e6,) * 4, SPEEDS, "split it"),
    ],
)
def test_a_bad_command_is_refused_and_moves_nothing(
    angles: tuple[float, ...], speeds: tuple[float, float, float, float], says: str
) -> None:
    a_world = world()
    with pytest.raises(WorldError, match=says) as caught:
        a_world.command("leader", angles, speeds)
    assert "\n" not in str(caught.value)
    assert not a_world.owes


@pytest.mark.parametrize(("robot", "count"), [("leader", 1), ("follower_1", 0), ("follower_1", 601), ("nobody", 1)])
def test_a_bad_frame_request_is_refused(robot: str, count: int) -> None:
    a_world = world()
    with pytest.raises(WorldError):
        a_world.request_frames(robot, count)
    assert not a_world.owes


def test_an_unknown_robot_gets_a_suggestion() -> None:
    with pytest.raises(WorldError, match="did you mean 'leader'"):
        world().command("laeder", STRAIGHT, SPEEDS)


def test_setups_that_cannot_be_are_refused() -> None:
    with pytest.raises(WorldError, match="overlap"):
        world(robots=(RobotStart("a", 0.5, 0.5, 0.0), RobotStart("b", 0.6, 0.5, 0.0)))
    with pytest.raises(WorldError, match="different"):
        world(robots=(PAIR[0], PAIR[0]))
    with pytest.raises(WorldError, match="lockstep"):
        world(lockstep=["follower_2"])
    with pytest.raises(ParameterError, match=r"camera.min_frames_per_second.*must divide physics_hz"):
        parameters(camera={"min_frames_per_second": 50})


def drive_both(a_world: World, follower_angles: tuple[float, float, float, float]) -> list[Any]:
    """Events of two moves of the leader, with another one of the follower between them."""
    a_world.command("leader", STRAIGHT, SPEEDS)
    events = run(a_world)
    a_world.command("follower_1", follower_angles, SPEEDS)
    a_world.request_frames("follower_1", 2)
    events += run(a_world)
    a_world.command("leader", STRAIGHT, SPEEDS)
    return events + run(a_world)


def same(a: Frame | JointStates | RobotPose, b: Frame | JointStates | RobotPose) -> bool:
    if isinstance(a, Frame) and isinstance(b, Frame):
        return (a.robot, a.stamp_ns) == (b.robot, b.stamp_ns) and np.array_equal(a.image, b.image)
    return a == b


def test_the_same_seed_gives_the_same_run_to_the_last_bit_even_interleaved() -> None:
    first = drive_both(world("bowl", seed=5), (1.0, -1.0, -1.0, 1.0))
    bystander = world("bowl", seed=8)
    second_world = world("bowl", seed=5)
    bystander.command("leader", STRAIGHT, SPEEDS)
    bystander.advance()
    second = drive_both(second_world, (1.0, -1.0, -1.0, 1.0))
    assert len(first) == len(second)
    assert all(same(a, b) for a, b in zip(first, second, strict=True))


def test_another_seed_gives_another_run() -> None:
    first = drive_both(world("bowl", seed=5), STRAIGHT)
    second = drive_both(world("bowl", seed=6), STRAIGHT)
    assert of_kind(first, RobotPose)[-1] != of_kind(second, RobotPose)[-1]


def test_the_leaders_path_does_not_depend_on_the_follower() -> None:
    def leader_path(follower_angles: tuple[float, float, float, float]) -> list[BodyState]:
        events = drive_both(world("bowl", seed=5), follower_angles)
        finals = [event for event in of_kind(events, RobotPose, "leader") if event.final]
        return [event.state for event in finals]

    assert leader_path((1.0, -1.0, -1.0, 1.0)) == leader_path((2.0, 2.0, 2.0, 2.0))
