"""When a heading is checked: after turns, after steps that end beside their forecasts, and where it is hardly known."""

import math

import numpy as np
import pytest

from robot_formation.alignment.precise.heading_check import Deviation, HeadingCheck, HeadingCheckParameters

P = HeadingCheckParameters()
KNOWN_RAD = 0.5 * P.sigma_rad
SIGMA_M = 0.004
"""What the forecasts state."""


def by_forecast(sigmas: float) -> Deviation:
    """A deviation by what its forecast states, which counts in the first timesteps."""
    return Deviation(sigmas * SIGMA_M, SIGMA_M)


def checks(beside_sigmas: list[float], *, turn_rad: float = 0.0, found_rad: float = 0.0) -> list[int]:
    """Timesteps, from 1 on, that check; each check changes the heading by `found_rad`."""
    check = HeadingCheck(P)
    timesteps = []
    for timestep, beside in enumerate(beside_sigmas, 1):
        check.stepped(turn_rad)
        if check.due(by_forecast(beside), KNOWN_RAD):
            timesteps.append(timestep)
            check.done(found_rad)
    return timesteps


def test_a_neighbour_that_goes_where_it_is_expected_to_is_never_checked() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1.0, 1000)
    assert checks((0.2 * noise).tolist()) == []
    assert len(checks((0.4 * noise).tolist())) <= 15  # 1.6 mm, as measured on straight tracks: one in a hundred


def late_checks(steady_m: float, late_m: float, sigma_m: float) -> bool:
    """Whether a deviation is checked after thirty others to both sides."""
    check = HeadingCheck(P)
    for timestep in range(30):
        check.stepped(0.0)
        assert not check.due(Deviation(steady_m * (-1) ** timestep, sigma_m), KNOWN_RAD)
    check.stepped(0.0)
    return check.due(Deviation(late_m, sigma_m), KNOWN_RAD)


def test_deviations_count_by_their_own_scatter_and_not_by_what_wide_forecasts_state() -> None:
    assert late_checks(0.001, 0.006, sigma_m=0.008)
    assert not late_checks(0.004, 0.006, sigma_m=0.008)  # this neighbour always scatters so


def test_a_deviation_within_the_looks_own_noise_is_no_reason() -> None:
    assert not late_checks(0.0, 0.004, sigma_m=0.008)


def test_forecasts_that_state_less_than_the_scatter_are_believed() -> None:
    assert late_checks(0.003, 0.013, sigma_m=0.0035)


def test_a_turn_does_not_hide_itself_by_the_scatter_that_it_makes() -> None:
    check = HeadingCheck(P)
    for timestep in range(30):
        check.stepped(0.0)
        check.due(Deviation(0.001 * (-1) ** timestep, 0.008), KNOWN_RAD)
    found = []
    for aside_m in (0.0017, 0.0052, 0.0087):  # a turn of 4 degrees a timestep, which nothing foretold
        check.stepped(0.0)
        found.append(check.due(Deviation(aside_m, 0.008), KNOWN_RAD))
    assert found[-1]


def test_a_timestep_of_which_nothing_is_known_counts_as_none() -> None:
    check = HeadingCheck(P)
    check.stepped(0.0)
    assert not check.due(None, KNOWN_RAD)
    check.stepped(0.0)
    assert check.due(by_forecast(1.1 * P.beside_sigmas), KNOWN_RAD)


@pytest.mark.parametrize("turn_deg", [8.0, -8.0, 4.0])
def test_a_turning_neighbour_is_checked_whenever_it_has_turned_so_far(turn_deg: float) -> None:
    every = math.floor(P.turned_rad / abs(math.radians(turn_deg))) + 1
    assert checks([0.0] * 30, turn_rad=math.radians(turn_deg)) == list(range(every, 31, every))


def test_turns_to_and_fro_cancel() -> None:
    check = HeadingCheck(P)
    for timestep in range(100):
        check.stepped(math.copysign(0.75 * P.turned_rad, timestep % 2 - 0.5))
        assert not check.due(by_forecast(0.0), KNOWN_RAD)


def test_several_small_deviations_to_one_side_count_as_a_large_one() -> None:
    step = 0.7 * P.beside_sigmas
    assert checks([1.1 * P.beside_sigmas]) == [1]
    assert checks([step, step]) == [2]
    assert checks([step, -step, step, -step]) == []


def test_each_check_that_finds_no_turn_doubles_the_bound() -> None:
    far = 1.1 * P.beside_sigmas
    one, *later = checks([far] * 12)
    assert one == 1
    assert later[0] > 2
    found = checks([far] * 12, found_rad=0.2)
    assert found == list(range(1, 13))  # follow-ups, and then the bound as it was


def test_after_an_unnoticed_turn_two_more_timesteps_are_checked() -> None:
    assert checks([1.1 * P.beside_sigmas, 0.0, 0.0, 0.0, 0.0], found_rad=0.2) == [1, 2, 3]
    assert checks([1.1 * P.beside_sigmas, 0.0, 0.0, 0.0, 0.0], found_rad=0.01) == [1]


def test_a_check_that_was_called_for_by_turns_finds_no_fault_with_the_forecasts() -> None:
    every = math.floor(P.turned_rad / 0.15) + 1
    assert checks([0.0] * 8, turn_rad=0.15, found_rad=0.08) == list(range(every, 9, every))


@pytest.mark.parametrize(("turned", "beside", "checked"), [(0.6, 0.6, True), (0.6, 0.4, False), (0.4, 0.9, False)])
def test_half_of_a_turn_and_half_of_a_deviation_call_for_a_check_together(
    turned: float, beside: float, checked: bool
) -> None:
    check = HeadingCheck(P)
    check.stepped(turned * P.turned_rad)
    assert check.due(by_forecast(beside * P.beside_sigmas), KNOWN_RAD) == checked


def test_a_check_after_turns_that_finds_their_end_is_followed_by_two_more() -> None:
    check = HeadingCheck(P)
    check.stepped(1.1 * P.turned_rad)
    assert check.due(by_forecast(0.0), KNOWN_RAD)
    check.done(-0.2)
    assert check.caught_up_rad == 0.0
    for due in (True, True, False):
        check.stepped(0.0)
        assert check.due(by_forecast(0.0), KNOWN_RAD) == due
        if due:
            check.done(0.0)


def test_half_of_what_a_check_after_turns_finds_counts_as_caught_up_in_its_timestep() -> None:
    check = HeadingCheck(P)
    check.stepped(1.1 * P.turned_rad)
    assert check.due(by_forecast(0.0), KNOWN_RAD)
    check.done(-0.08)
    assert check.caught_up_rad == pytest.approx(0.04)
    check.stepped(0.0)
    assert check.caught_up_rad == 0.0


def test_nothing_is_caught_up_in_follow_ups() -> None:
    check = HeadingCheck(P)
    for beside, found_rad in ((1.1 * P.beside_sigmas, 0.2), (0.0, 0.08), (0.0, 0.08)):
        check.stepped(0.0)
        assert check.due(by_forecast(beside), KNOWN_RAD)
        check.done(found_rad)
        assert check.caught_up_rad == 0.0


def test_nothing_is_caught_up_after_a_turn_that_nothing_foretold() -> None:
    check = HeadingCheck(P)
    check.stepped(0.0)
    assert check.due(by_forecast(1.1 * P.beside_sigmas), KNOWN_RAD)
    check.done(0.2)
    assert check.caught_up_rad == 0.0


def test_much_that_is_found_where_the_heading_was_hardly_known_is_caught_up() -> None:
    check = HeadingCheck(P)
    check.stepped(0.0)
    assert check.due(by_forecast(0.0), 1.01 * P.sigma_rad)
    check.done(0.2)
    assert check.caught_up_rad == pytest.approx(0.1)
    check.stepped(0.0)
    assert not check.due(by_forecast(0.0), KNOWN_RAD)


def test_a_heading_that_is_hardly_known_is_checked() -> None:
    check = HeadingCheck(P)
    check.stepped(0.0)
    assert check.due(by_forecast(0.0), 1.01 * P.sigma_rad)
    check.done(0.0)
    check.stepped(0.0)
    assert not check.due(by_forecast(0.0), 0.99 * P.sigma_rad)


def test_a_check_that_was_not_made_is_still_called_for() -> None:
    check = HeadingCheck(P)
    check.stepped(1.01 * P.turned_rad)
    assert check.due(by_forecast(0.0), KNOWN_RAD)
    check.stepped(0.0)
    assert check.due(by_forecast(0.0), KNOWN_RAD)
