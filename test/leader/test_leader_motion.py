"""The leader steps when everybody is ready, counts, and ends."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.leader_motion import NOTHING, Leader, LeaderAction, LeaderParameters

STEP = LeaderAction(move=Motion(x_m=0.05))


def leader(timesteps: int = 3, followers: tuple[str, ...] = ("follower_1", "follower_2")) -> Leader:
    return Leader(LeaderParameters(timesteps=timesteps, followers=followers))


def test_a_tour_is_tick_0_then_a_step_and_a_tick_for_each_timestep_then_the_end() -> None:
    tour = leader(timesteps=3, followers=("follower_1",))
    found = [tour.start()]
    for timestep in range(3):
        found += [tour.follower_done("follower_1", timestep), tour.moved()]
    found.append(tour.follower_done("follower_1", 3))
    expected = [LeaderAction(done=0)]
    for timestep in (1, 2, 3):
        expected += [STEP, LeaderAction(done=timestep)]
    assert found == [*expected, LeaderAction(finished=True)]
    assert tour.finished


@pytest.mark.parametrize("order", [("follower_1", "follower_2"), ("follower_2", "follower_1")])
def test_the_last_missing_follower_starts_the_step_whoever_it_is(order: tuple[str, str]) -> None:
    tour = leader()
    tour.start()
    assert tour.follower_done(order[0], 0) == NOTHING
    assert list(tour.waiting_for) == [order[1]]
    assert tour.follower_done(order[1], 0) == STEP


def test_no_step_begins_before_the_leader_stands() -> None:
    tour = leader(followers=("follower_1",))
    tour.start()
    assert tour.follower_done("follower_1", 0) == STEP
    assert tour.follower_done("follower_1", 1) == NOTHING
    assert tour.timestep == 1


@pytest.mark.parametrize(
    ("robot", "tick"),
    [("follower_1", 0), ("follower_1", 2), ("follower_1", 7), ("follower_3", 1), ("leader", 1)],
    ids=["a duplicate", "one that skips", "one far ahead", "a stranger's", "the leader's own"],
)
def test_a_tick_out_of_order_is_ignored(robot: str, tick: int) -> None:
    tour = leader(followers=("follower_1",))
    tour.start()
    tour.follower_done("follower_1", 0)
    tour.moved()
    assert tour.follower_done(robot, tick) == NOTHING
    assert tour.timestep == 1
    assert tour.follower_done("follower_1", 1) == STEP


def test_a_moved_that_nobody_asked_for_is_no_tick() -> None:
    tour = leader()
    tour.start()
    assert tour.moved() == NOTHING
    tour.follower_done("follower_1", 0)
    tour.follower_done("follower_2", 0)
    assert tour.moved() == LeaderAction(done=1)
    assert tour.moved() == NOTHING


def test_paused_the_running_step_ends_but_no_new_one_begins_until_resume() -> None:
    tour = leader(followers=("follower_1",))
    tour.start()
    tour.follower_done("follower_1", 0)
    tour.paused = True
    assert tour.moved() == LeaderAction(done=1)
    assert tour.follower_done("follower_1", 1) == NOTHING
    assert tour.resume() == STEP
    assert tour.timestep == 2


def test_resume_without_a_reason_starts_nothing() -> None:
    tour = leader()
    tour.start()
    assert tour.resume() == NOTHING
    tour.follower_done("follower_1", 0)
    assert tour.resume() == NOTHING


def test_paused_before_the_end_the_tour_ends_on_resume() -> None:
    tour = leader(timesteps=1, followers=("follower_1",))
    tour.start()
    tour.follower_done("follower_1", 0)
    tour.moved()
    tour.paused = True
    assert tour.follower_done("follower_1", 1) == NOTHING
    assert tour.resume() == LeaderAction(finished=True)


def test_after_the_end_nothing_happens_any_more() -> None:
    tour = leader(timesteps=1, followers=("follower_1",))
    tour.start()
    tour.follower_done("follower_1", 0)
    tour.moved()
    tour.follower_done("follower_1", 1)
    assert tour.follower_done("follower_1", 2) == NOTHING
    assert tour.moved() == NOTHING
    assert tour.resume() == NOTHING


def test_an_empty_formation_never_keeps_the_leader_waiting() -> None:
    assert list(leader(followers=()).waiting_for) == []


@given(
    events=st.lists(
        st.one_of(
            st.tuples(st.sampled_from(["follower_1", "follower_2"]), st.integers(0, 5)),
            st.sampled_from(["moved", "pause", "resume"]),
        ),
        max_size=60,
    )
)
def test_whatever_comes_ticks_rise_by_one_and_every_step_is_followed_by_its_tick(
    events: list[str | tuple[str, int]],
) -> None:
    tour = leader(timesteps=3)
    ticks = [tour.start().done]
    steps = 0
    for event in events:
        if event == "pause":
            tour.paused = True
            continue
        action = {"moved": tour.moved, "resume": tour.resume}[event]() if isinstance(event, str) else None
        if action is None:
            action = tour.follower_done(*event)
        steps += action.move is not None
        if action.done is not None:
            ticks.append(action.done)
        assert ticks[-1] is not None
        assert steps - 1 <= ticks[-1] <= steps
    assert ticks == list(range(len(ticks)))
    assert len(ticks) <= 4
