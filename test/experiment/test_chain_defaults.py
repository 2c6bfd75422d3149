"""Defaults that follow from a scenario's schedule."""

import pytest

from robot_formation.alignment.precise.heading_check import HeadingCheckParameters
from robot_formation.alignment.precise.precise_mode import PreciseParameters
from robot_formation.alignment.precise.step_models import StepParameters
from robot_formation.experiment.scenario import load_track, override

PARAMETER = "fine_tuner.precise.filter.step.change_sigma_rad"


def precise(*settings: str) -> PreciseParameters:
    return override(load_track("one"), settings).fine_tuner.precise


@pytest.mark.parametrize("schedule", ["turns", "wave"])
def test_headings_are_checked_where_robots_wait(schedule: str) -> None:
    found = precise(f"schedule={schedule}")
    assert found.heading_check == HeadingCheckParameters()
    assert found.filter.step == StepParameters()


@pytest.mark.parametrize("schedule", ["together", "timer"])
def test_no_headings_are_checked_and_few_turns_expected_where_robots_move_at_once(schedule: str) -> None:
    found = precise(f"schedule={schedule}")
    assert min(found.heading_check.turned_rad, found.heading_check.sigma_rad) >= 1000.0
    assert found.heading_check.beside_sigmas >= 1000.0
    assert found.filter.step.change_sigma_rad < 0.2 * StepParameters().change_sigma_rad


def test_a_scenario_may_set_both_itself() -> None:
    assert precise("schedule=timer", f"{PARAMETER}=0.02").filter.step.change_sigma_rad == 0.02
    checked = precise("schedule=timer", "fine_tuner.precise.heading_check.turned_rad=0.3")
    assert checked.heading_check.turned_rad == 0.3
    assert checked.filter.step == StepParameters()
