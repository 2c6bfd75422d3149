"""A robot whose reference dot leaves the plate is held there; one that would start beyond it is refused."""

import math
from typing import Any

import pytest

from robot_formation.surface import PLATE_SIZE_M, SURFACES, make_surface
from robot_formation.world.checks import WorldError
from robot_formation.world.events import JointStates, LeftPlate, RobotPose
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World
from world_helpers import SPEEDS, of_kind, run, world

NEAR_EDGE = (RobotStart("leader", 0.89, 1.7, 0.5 * math.pi), RobotStart("follower_1", 1.3, 0.9, 0.5 * math.pi))


def leave(**values: bool) -> tuple[World, list[Any]]:
    a_world = world("bowl", NEAR_EDGE, **values)
    a_world.command("leader", (8.0,) * 4, SPEEDS)
    return a_world, run(a_world)


@pytest.mark.parametrize("sleep", [True, False])
def test_a_robot_is_held_where_its_dot_leaves_the_plate(sleep: bool) -> None:
    a_world, events = leave(sleep=sleep)
    (left,) = of_kind(events, LeftPlate)
    assert left.robot == "leader"
    assert left.stamp_ns == a_world.stamp_ns
    assert PLATE_SIZE_M < left.y_m < PLATE_SIZE_M + 0.03
    state = a_world.ground_truth("leader")
    assert (state.linear_m_s, state.angular_rad_s) == ((0.0,) * 3, (0.0,) * 3)
    dot = state.pose.place((0.0, 0.0, 0.216))
    assert (left.x_m, left.y_m) == pytest.approx(dot[:2], abs=1e-9)
    final = of_kind(events, JointStates, "leader")[-1]
    assert final.final
    assert not any(final.velocities)
    assert of_kind(events, RobotPose, "leader")[-1].final
    assert not a_world.owes


def test_it_takes_no_more_commands_and_the_others_go_on() -> None:
    a_world, _ = leave()
    before = a_world.ground_truth("leader")
    with pytest.raises(WorldError, match="has left the plate"):
        a_world.command("leader", (-8.0,) * 4, SPEEDS)
    a_world.command("follower_1", (1.0,) * 4, SPEEDS)
    a_world.request_frames("follower_1", 2)
    assert of_kind(run(a_world), JointStates, "follower_1")[-1].final
    assert a_world.ground_truth("leader") == before


def test_wheels_may_stand_beside_the_plate() -> None:
    starts = (RobotStart("leader", 0.05, 0.6, 0.5 * math.pi), RobotStart("follower_1", 1.7, 0.6, 0.5 * math.pi))
    a_world = world("bowl", starts)
    a_world.command("leader", (1.6,) * 4, SPEEDS)
    assert of_kind(run(a_world), LeftPlate) == []


@pytest.mark.parametrize("place", [(-0.1, 0.5), (0.5, -0.1), (1.9, 0.5), (0.5, 1.9)])
def test_a_start_beyond_the_plate_is_refused_with_one_line(place: tuple[float, float]) -> None:
    with pytest.raises(WorldError, match=r"'leader' can't start: its reference dot .* beyond the plate") as caught:
        world("plane", (RobotStart("leader", *place, 0.0),))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", sorted(SURFACES))
def test_on_every_surface_a_drive_off_the_plate_ends_soon_and_near(name: str) -> None:
    surface = make_surface(name)
    start = RobotStart("leader", 1.6, 1.2, 0.0, camera=False)
    a_world = World(surface, [start], WorldParameters(), seed=2)
    a_world.command("leader", (20.0,) * 4, (8.0,) * 4)
    (left,) = of_kind(run(a_world), LeftPlate)
    assert abs(left.x_m - PLATE_SIZE_M) < 0.05
    assert math.isfinite(a_world.ground_truth("leader").z_m)
