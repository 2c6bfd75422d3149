"""Single steps and another start time change nothing else."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from robot_formation.surface import make_surface
from robot_formation.world.events import Event, Frame
from robot_formation.world.world import World
from world_helpers import PAIR, SPEEDS, STRAIGHT, parameters, run, world


def plain(events: Iterable[Event]) -> list[object]:
    """Events as values that compare to the last bit."""
    return [
        (event.robot, event.stamp_ns, event.image.tobytes()) if isinstance(event, Frame) else repr(event)
        for event in events
    ]


def begun(a_world: World) -> World:
    a_world.request_frames("follower_1", 3)
    a_world.command("leader", (4.0,) * 4, SPEEDS)
    return a_world


def test_single_steps_give_the_same_events_as_going_on() -> None:
    by_steps = begun(world("bowl", seed=5))
    events: list[Event] = []
    while by_steps.owes:
        before = by_steps.step_count
        events += by_steps.step()
        assert by_steps.step_count == before + 1
    assert by_steps.step() == []
    assert plain(events) == plain(run(begun(world("bowl", seed=5))))


@pytest.mark.parametrize("seed", [1, 3, 11])
def test_who_asks_where_a_standing_robot_is_changes_no_later_answer(seed: int) -> None:
    """Bullet changes the last digit of a standing body's orientation now and then."""
    told = []
    for asks in (False, True):
        made = world("bowl", seed=seed)
        if asks:
            made.ground_truth("follower_1")
        for _ in range(4):
            made.command("leader", (2.0,) * 4, SPEEDS)
            run(made)
        told.append(made.ground_truth("follower_1"))
    assert told[0] == told[1]


def test_another_start_time_shifts_the_stamps_and_nothing_else() -> None:
    def events(start_ns: int) -> list[Event]:
        made = World(make_surface("bowl"), PAIR, parameters(), seed=5, start_ns=start_ns)
        made.command("leader", STRAIGHT, SPEEDS)
        made.request_frames("follower_1", 20)
        return run(made)

    first, later = events(0), events(7 * 10**9)
    assert len(first) == len(later)
    for a, b in zip(first, later, strict=True):
        assert b.stamp_ns - a.stamp_ns == 7 * 10**9
        if isinstance(a, Frame):
            assert isinstance(b, Frame)
            assert np.array_equal(a.image, b.image)
        else:
            assert replace(b, stamp_ns=a.stamp_ns) == a
