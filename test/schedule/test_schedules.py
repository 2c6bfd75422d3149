"""Schedules as pure functions: when a timestep begins, by the clock and by ticks."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.parameters import ParameterError
from robot_formation.schedule.schedules import Schedule, Spacing, begin_s, check_spacing, may_begin_in_wave
from robot_formation.schedule.start_rule import StartRule


def test_the_collection_phase_has_longer_periods() -> None:
    assert [begin_s(timestep, 2.0) for timestep in range(7)] == [0.0, 8.0, 16.0, 24.0, 32.0, 34.0, 36.0]


@given(st.integers(1, 8), st.integers(1, 6), st.randoms(use_true_random=False))
def test_a_wave_never_stops_and_neighbours_stay_within_a_timestep(robots: int, timesteps: int, random: Random) -> None:
    """Whoever may begin begins, in any order: all come to the end, and a look is at a robot that waits for it."""
    finished = dict.fromkeys(range(robots), 0)
    while any(done < timesteps for done in finished.values()):
        able = [
            robot
            for robot, done in finished.items()
            if done < timesteps and may_begin_in_wave(robot, robots, done + 1, finished)
        ]
        assert able, finished
        finished[random.choice(able)] += 1
        for left, right in zip(range(robots), range(1, robots), strict=False):
            assert finished[right] <= finished[left] <= finished[right] + 1


def test_a_follower_in_a_wave_waits_for_both_neighbours() -> None:
    rule = StartRule(Schedule.WAVE, last=False, timesteps=3)
    assert not rule.may_begin(0)
    rule.left = 0
    assert rule.may_begin(0)
    rule.left = 1
    assert not rule.may_begin(1)
    rule.right = 0
    assert rule.may_begin(1)
    rule.left, rule.right = 4, 3
    assert not rule.may_begin(4)  # the tick that ends the tour is no timestep


def test_the_clock_alone_begins_timesteps_of_the_timer() -> None:
    rule = StartRule(Schedule.TIMER, period_s=1.0, timesteps=2)
    assert rule.may_begin(0)
    assert not rule.may_begin(1)
    rule.left = 5
    rule.now_ns = 3_999_999_999
    assert not rule.may_begin(1)
    rule.now_ns += 1
    assert rule.may_begin(1)
    rule.now_ns = 10**12
    assert not rule.may_begin(3)


@pytest.mark.parametrize(
    ("schedule", "spacing", "corrected"),
    [
        (Schedule.TURNS, Spacing.RIGID, [True, True, True]),
        (Schedule.WAVE, Spacing.RIGID, [True, True, True]),
        (Schedule.TOGETHER, Spacing.RIGID, [True, True, True]),
        (Schedule.TIMER, Spacing.RIGID, [True, True, False]),
        (Schedule.TIMER, Spacing.DELAYED, [True, False, False]),
    ],
)
def test_which_timesteps_have_corrections(schedule: Schedule, spacing: Spacing, corrected: list[bool]) -> None:
    rule = StartRule(schedule, spacing)
    assert [rule.corrects(timestep) for timestep in (0, 3, 4)] == corrected


@pytest.mark.parametrize("schedule", [Schedule.TURNS, Schedule.WAVE])
def test_delayed_places_need_moves_at_the_same_time(schedule: Schedule) -> None:
    with pytest.raises(ParameterError, match="together or timer"):
        check_spacing(schedule, Spacing.DELAYED)
