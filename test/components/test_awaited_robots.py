"""Whom the world waits for: whoever has something to order, whatever the order in which messages of topics come."""

import pytest

from robot_formation.components.awaited_robots import AwaitedRobots
from robot_formation.schedule.schedules import Schedule

ROBOTS = ("leader", "follower_1", "follower_2")


def test_nobody_is_awaited_in_turns() -> None:
    awaited = AwaitedRobots(Schedule.TURNS, ROBOTS, 5, 1.0)
    awaited.ordered("leader")
    awaited.rests("leader")
    awaited.idle("leader")
    assert not awaited.any
    assert awaited.names() == []


def test_a_wave_goes_along_the_chain() -> None:
    awaited = AwaitedRobots(Schedule.WAVE, ROBOTS, 5, 1.0)
    assert awaited.names() == ["follower_1"]
    awaited.ordered("follower_1", frames=True)
    assert not awaited.any
    awaited.looked("follower_1")
    assert awaited.names() == ["follower_1"]
    awaited.finished("leader", 0)
    awaited.finished("follower_1", 0)
    assert awaited.names() == ["leader", "follower_2"]


@pytest.mark.parametrize("early", [False, True])
def test_an_order_may_come_before_the_tick_that_allowed_it(early: bool) -> None:
    """Ticks and orders come on different topics: the order of the next timestep may arrive first."""
    awaited = AwaitedRobots(Schedule.WAVE, ROBOTS[:2], 5, 1.0)
    awaited.ordered("follower_1", frames=True)
    awaited.looked("follower_1")
    if early:
        awaited.ordered("leader")
        awaited.finished("follower_1", 0)
    else:
        awaited.finished("follower_1", 0)
        assert awaited.names() == ["leader"]
        awaited.ordered("leader")
    assert not awaited.any
    awaited.rests("leader")
    assert awaited.names() == ["leader"]
    awaited.finished("leader", 1)
    assert awaited.names() == ["follower_1"]


@pytest.mark.parametrize("early", [False, True])
def test_a_robot_that_begins_before_it_was_heard_to_end_has_begun_the_next_timestep(early: bool) -> None:
    awaited = AwaitedRobots(Schedule.TOGETHER, ROBOTS[:2], 5, 1.0)
    awaited.ordered("follower_1", frames=True)
    awaited.looked("follower_1")
    if early:
        awaited.ordered("follower_1")
        awaited.idle("follower_1")
    else:
        awaited.idle("follower_1")
        awaited.ordered("follower_1")
    awaited.ordered("leader")
    awaited.begun("leader", 1)
    assert not awaited.any
    awaited.rests("leader")
    assert awaited.names() == ["leader"]  # another leg may follow
    awaited.ordered("leader")
    awaited.rests("leader")
    awaited.idle("leader")
    assert not awaited.any
    awaited.rests("follower_1")
    assert awaited.names() == ["follower_1"]


def test_the_others_are_awaited_if_the_leaders_order_comes_before_its_tick() -> None:
    awaited = AwaitedRobots(Schedule.TOGETHER, ROBOTS[:2], 5, 1.0)
    awaited.ordered("follower_1", frames=True)
    awaited.looked("follower_1")
    awaited.idle("follower_1")
    awaited.ordered("leader")
    assert awaited.names() == ["follower_1"]


def test_all_move_at_once_when_the_leader_has_begun() -> None:
    awaited = AwaitedRobots(Schedule.TOGETHER, ROBOTS, 5, 1.0)
    for robot in ROBOTS[1:]:
        awaited.begun(robot, 0)
        awaited.ordered(robot, frames=True)
        awaited.looked(robot)
        awaited.idle(robot)
    assert not awaited.any
    awaited.begun("leader", 1)
    assert awaited.names() == list(ROBOTS)


def test_a_period_awaits_everybody_but_who_is_late() -> None:
    awaited = AwaitedRobots(Schedule.TIMER, ROBOTS, 5, 1.0)
    assert awaited.names() == ["follower_1", "follower_2"]
    for robot in ROBOTS[1:]:
        awaited.ordered(robot, frames=True)
    awaited.looked("follower_1")
    awaited.idle("follower_1")
    assert awaited.period_end_ns == 4 * 10**9
    awaited.period_ended()
    assert awaited.names() == ["leader", "follower_1"]
    awaited.looked("follower_2")
    awaited.idle("follower_2")
    assert awaited.names() == list(ROBOTS)
    assert awaited.period_end_ns == 8 * 10**9


def test_nothing_is_awaited_after_the_last_timestep() -> None:
    awaited = AwaitedRobots(Schedule.TIMER, ("leader",), 1, 1.0)
    for _ in range(2):
        assert awaited.period_end_ns is not None
        awaited.period_ended()
    assert awaited.period_end_ns is None  # time stands still once nobody moves
    awaited.ordered("leader")
    awaited.rests("leader")
    awaited.idle("leader")
    assert not awaited.any


@pytest.mark.parametrize("schedule", [Schedule.WAVE, Schedule.TOGETHER])
def test_a_lost_robot_is_not_awaited_and_the_run_is_stuck_once_the_others_have_nothing_to_do(
    schedule: Schedule,
) -> None:
    awaited = AwaitedRobots(schedule, ROBOTS, 5, 1.0)
    aligned = [] if schedule is Schedule.WAVE else ROBOTS[2:]  # at the same time as the one that is lost
    for robot in ("follower_1", *aligned):
        awaited.ordered(robot, frames=True)
        awaited.looked(robot)
    for robot in aligned:
        awaited.idle(robot)
    assert not awaited.stuck
    awaited.give_up("follower_1")
    assert awaited.names() == []
    assert awaited.stuck


def test_others_finish_what_they_have_begun_before_the_run_is_stuck() -> None:
    awaited = AwaitedRobots(Schedule.TOGETHER, ROBOTS, 5, 1.0)
    for robot in ROBOTS[1:]:
        awaited.begun(robot, 0)
        awaited.ordered(robot)
        awaited.rests(robot)
        awaited.idle(robot)
    awaited.begun("leader", 1)
    for robot in ROBOTS:
        awaited.ordered(robot)
        awaited.rests(robot)
    awaited.idle("leader")
    awaited.give_up("follower_1")
    assert awaited.names() == ["follower_2"]
    assert not awaited.stuck
    awaited.idle("follower_2")
    assert awaited.stuck


def test_all_align_at_the_same_time_in_together_and_along_the_chain_in_wave() -> None:
    assert AwaitedRobots(Schedule.TOGETHER, ROBOTS, 5, 1.0).names() == list(ROBOTS[1:])
    assert AwaitedRobots(Schedule.WAVE, ROBOTS, 5, 1.0).names() == [ROBOTS[1]]


@pytest.mark.parametrize("schedule", [Schedule.TURNS, Schedule.TIMER])
def test_a_run_by_turns_or_by_the_clock_is_never_stuck(schedule: Schedule) -> None:
    awaited = AwaitedRobots(schedule, ROBOTS, 5, 1.0)
    for robot in ROBOTS[1:]:
        awaited.give_up(robot)
    assert not awaited.stuck
