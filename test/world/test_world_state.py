"""Save and restore go on to the last bit; single steps and another start time change nothing else."""

import pickle
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robot_formation.surface import make_surface
from robot_formation.world import Frame, RobotStart, World, WorldError
from world_helpers import PAIR, SPEEDS, STRAIGHT, parameters, run, world

TOUCHING = (
    RobotStart("leader", 0.5, 0.5, 0.0, camera=False),
    RobotStart("follower_1", 0.9, 0.5, 0.0),
)


def plain(events: Sequence[Any]) -> list[str | tuple[str, int, bytes]]:
    """Events as values that compare to the last bit."""
    return [
        (event.robot, event.stamp_ns, event.image.tobytes()) if isinstance(event, Frame) else repr(event)
        for event in events
    ]


def go_on(a_world: World) -> list[str | tuple[str, int, bytes]]:
    """What happens from here: the rest of what is owed, then two more motions with pictures."""
    events = run(a_world)
    for robot, angles in (("follower_1", (1.0, -1.0, -1.0, 1.0)), ("leader", (4.0,) * 4)):
        a_world.command(robot, angles, SPEEDS)
        a_world.request_frames("follower_1", 2)
        events += run(a_world)
    return plain(events)


def in_the_middle(a_world: World, steps: int) -> World:
    a_world.request_frames("follower_1", 3)
    a_world.command("leader", (4.0,) * 4, SPEEDS)
    for _ in range(steps):
        a_world.step()
    return a_world


@pytest.mark.parametrize("mode", ["pwm_stop", "pid"])
@pytest.mark.parametrize("steps", [0, 37, 100])
@pytest.mark.parametrize("robots", [PAIR, TOUCHING], ids=["apart", "touching"])
def test_a_restored_world_goes_on_to_the_last_bit_also_in_a_fresh_one(
    mode: str, steps: int, robots: tuple[RobotStart, RobotStart]
) -> None:
    values: dict[str, Any] = {"seed": 5, "motor": {"drive_mode": mode}}
    a_world = in_the_middle(world("bowl", robots, **values), steps)
    state = a_world.save()
    first = go_on(a_world)
    a_world.restore(state)
    assert a_world.step_count == state.step_count
    assert go_on(a_world) == first
    fresh = world("bowl", robots, **values)
    fresh.restore(pickle.loads(pickle.dumps(state)))
    assert go_on(fresh) == first


def test_saving_changes_nothing() -> None:
    first = go_on(in_the_middle(world("bowl", seed=5), 50))
    a_world = in_the_middle(world("bowl", seed=5), 50)
    a_world.save()
    assert go_on(a_world) == first


def test_commands_that_wait_for_others_and_owed_frames_are_kept() -> None:
    a_world = world(lockstep=["leader", "follower_1"])
    a_world.command("leader", STRAIGHT, SPEEDS)
    state = a_world.save()
    fresh = world(lockstep=["leader", "follower_1"])
    fresh.restore(state)
    assert not fresh.owes
    fresh.command("follower_1", STRAIGHT, SPEEDS)
    assert {event.robot for event in run(fresh)} == {"leader", "follower_1"}


def test_a_state_of_another_setup_is_refused() -> None:
    state = world("bowl", seed=5).save()
    for other in (world("plane", seed=5), world("bowl", seed=6), world("bowl", PAIR[:1], seed=5)):
        with pytest.raises(WorldError, match="another setup"):
            other.restore(state)
        assert other.step_count == 0


def test_single_steps_give_the_same_events_as_going_on() -> None:
    by_steps = in_the_middle(world("bowl", seed=5), 0)
    events = []
    while by_steps.owes:
        before = by_steps.step_count
        events += by_steps.step()
        assert by_steps.step_count == before + 1
    assert by_steps.step() == []
    assert plain(events) == plain(run(in_the_middle(world("bowl", seed=5), 0)))


def test_another_start_time_shifts_the_stamps_and_nothing_else() -> None:
    def events(start_ns: int) -> list[Any]:
        made = World(make_surface("bowl"), PAIR, parameters(), seed=5, start_ns=start_ns)
        made.command("leader", STRAIGHT, SPEEDS)
        made.request_frames("follower_1", 20)
        return run(made)

    first, later = events(0), events(7 * 10**9)
    assert len(first) == len(later)
    for a, b in zip(first, later, strict=True):
        assert b.stamp_ns - a.stamp_ns == 7 * 10**9
        if isinstance(a, Frame):
            assert np.array_equal(a.image, b.image)
        else:
            assert replace(b, stamp_ns=a.stamp_ns) == a
