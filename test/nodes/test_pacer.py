"""The pacer holds simulated time to the wall clock and never sleeps itself."""

import pytest

from robot_formation.nodes.host.component_node import Pacer


class Clock:
    now = 50.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_without_a_factor_nothing_waits(clock: Clock) -> None:
    pacer = Pacer(0.0, clock)
    pacer.worked(10**9)
    assert pacer.left_s == 0.0


@pytest.mark.parametrize("factor", [0.001, 1.0, 2.0])
def test_work_waits_until_the_wall_clock_has_caught_up(clock: Clock, factor: float) -> None:
    pacer = Pacer(factor, clock)
    pacer.worked(0)
    pacer.worked(10**9)
    assert pacer.left_s == pytest.approx(1.0 / factor)
    clock.now += 0.25 / factor
    assert pacer.left_s == pytest.approx(0.75 / factor)
    clock.now += 1.0 / factor
    assert pacer.left_s == 0.0


def test_standing_still_builds_up_no_credit(clock: Clock) -> None:
    pacer = Pacer(1.0, clock)
    pacer.worked(0)
    clock.now += 100.0
    pacer.worked(10**9)
    pacer.worked(2 * 10**9)
    assert pacer.left_s == pytest.approx(1.0)


def test_a_factor_that_is_set_later_counts_from_then_on(clock: Clock) -> None:
    pacer = Pacer(0.0, clock)
    pacer.worked(500 * 10**9)
    pacer.factor = 1.0
    pacer.worked(501 * 10**9)
    assert pacer.left_s == pytest.approx(1.0)
