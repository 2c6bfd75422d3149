"""The step models that are kept side by side: what each assumes, and how looks tell them apart."""

import math

import numpy as np
import pytest

from robot_formation.alignment.precise.step_models import Drives, StepModel, StepModels, StepParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion

PARAMETERS = StepParameters()
LEAST_LEG_M = 0.0022
FORECAST = np.diag([0.004**2, 0.002**2, 0.01**2])
OWN = Drives(slip=0.02, overshoot=0.0, count=20)


def models(step: Motion, *, first: bool = False, own: Drives = OWN, inflation: float = 1.0) -> list[StepModel]:
    made = StepModels(PARAMETERS, LEAST_LEG_M, wheel_lever_m=0.2)
    return made.models(UncertainMotion.of(step, FORECAST), own, inflation, first)


def sigmas(model: StepModel) -> list[float]:
    return [math.sqrt(variance) for variance in np.diag(model.covariance)]


def test_the_first_step_is_known_beforehand_but_for_slip() -> None:
    (only,) = models(Motion(0.05), first=True, own=Drives())
    assert only.step == Motion(0.05)
    assert not only.slip_included
    assert sigmas(only) == pytest.approx([PARAMETERS.length_sigma_m, 0.002, PARAMETERS.turn_sigma_rad])


def test_a_step_ahead_slips_aside_like_the_followers_own_drive() -> None:
    ahead, *_ = models(Motion(0.05))
    assert (ahead.step.x_m, ahead.step.y_m) == pytest.approx((0.05, OWN.slip * 0.05))
    assert sigmas(ahead)[1] == pytest.approx(PARAMETERS.aside_sigma_m)


def test_a_forecast_leg_aside_that_no_drive_makes_is_left_out_of_the_step_ahead_only() -> None:
    ahead, *by_forecast = models(Motion(0.05, 0.002), own=Drives(count=5))
    assert ahead.step.y_m == pytest.approx(0.0, abs=1e-12)
    assert all(model.step.y_m == 0.002 for model in by_forecast[: len(PARAMETERS.scales)])


@pytest.mark.parametrize(
    ("leg_m", "reached_m"), [(0.002, 0.0), (0.0035, 0.0015), (0.005, 0.0034), (0.008, 0.007), (0.02, 0.0196)]
)
def test_legs_aside_end_short_as_measured(leg_m: float, reached_m: float) -> None:
    for sign in (1.0, -1.0):
        (only,) = models(Motion(0.05, sign * leg_m), first=True, own=Drives())
        assert only.step.y_m == pytest.approx(sign * reached_m, abs=1e-4)


def test_on_an_arc_the_way_aside_is_half_the_forecasts_and_half_the_arcs() -> None:
    turn = 0.14
    forecast = Motion(0.05, 0.001, turn)
    ahead, *_ = models(forecast, own=Drives(count=5))
    leg_m = 0.05 * math.sin(turn) - 0.05 * math.tan(0.5 * turn) * math.cos(turn)  # to the other side than the arc
    lost_m = 0.002
    arc_m = 0.05 * math.tan(0.5 * turn) + lost_m * math.cos(turn)
    assert leg_m == pytest.approx(0.0035, abs=1e-4)
    assert ahead.step.y_m == pytest.approx(0.5 * (0.001 + arc_m), abs=2e-5)
    assert ahead.slip_included == 0.5


def test_the_models_by_forecast_are_as_certain_as_the_forecast_times_their_scale() -> None:
    _, *by_forecast = models(Motion(0.05, 0.02))
    added = np.diag([PARAMETERS.length_sigma_m, PARAMETERS.forecast_aside_sigma_m, PARAMETERS.turn_sigma_rad]) ** 2
    for model, scale in zip(by_forecast, PARAMETERS.scales, strict=False):
        assert np.diag(model.covariance)[:2] == pytest.approx((scale**2 * FORECAST + added).diagonal()[:2])
        assert model.slip_included
        assert model.step == Motion(0.05, 0.02)


def test_a_high_nis_widens_what_the_step_ahead_leaves_aside_and_no_other_direction() -> None:
    usual, wide = models(Motion(0.05))[0], models(Motion(0.05), inflation=4.0)[0]
    assert sigmas(wide)[1] == pytest.approx(4.0 * sigmas(usual)[1])
    assert [sigmas(wide)[0], sigmas(wide)[2]] == pytest.approx([sigmas(usual)[0], sigmas(usual)[2]])


def test_a_turn_too_small_to_tell_from_errors_of_the_heading_is_none() -> None:
    for model in models(Motion(0.05, 0.0, 0.015)):
        assert model.step.yaw_rad == 0.0
    assert models(Motion(0.05, 0.0, 0.1))[0].step.yaw_rad == 0.1


def test_on_another_arc_the_way_aside_goes_with_the_turn() -> None:
    step = Motion(0.05, 0.05 * math.tan(0.05), 0.1)
    ahead, bend = models(step)[0], models(step)[-1]
    more = bend.covariance - ahead.covariance
    assert bend.step == ahead.step
    # One more source of error: a turn d leads 0.5 x d aside, as the chord of an arc does.
    expected = np.outer([0.0, 0.025, 1.0], [0.0, 0.025, 1.0]) * PARAMETERS.bend_sigma_rad**2
    assert more == pytest.approx(expected)
    assert np.linalg.matrix_rank(more, tol=1e-12) == 1


def test_without_looks_the_costs_are_those_beforehand() -> None:
    p = PARAMETERS
    found = StepModels(p, LEAST_LEG_M, 0.2).costs
    assert found == [0.0, p.forecast_cost, p.forecast_cost, p.change_cost, p.bend_cost]


def test_the_model_that_foretells_the_looks_becomes_the_most_likely_and_never_by_more_than_the_bound() -> None:
    made = StepModels(PARAMETERS, LEAST_LEG_M, 0.2)
    for _ in range(200):
        before = made.costs
        # -2 log likelihoods of the hypotheses, the model's own included: the second model foretells best.
        made.judge([(k, cost + (0.0 if k == 1 else 50.0)) for k, cost in enumerate(before)])
    costs = made.costs
    assert min(range(len(costs)), key=costs.__getitem__) == 1
    assert max(costs) - min(costs) < 9.0 / (1.0 - 0.85) + 10.0


def test_what_was_learned_fades_when_the_neighbour_changes() -> None:
    made = StepModels(PARAMETERS, LEAST_LEG_M, 0.2)

    def look(best: int) -> None:
        made.judge([(k, cost + (0.0 if k == best else 6.0)) for k, cost in enumerate(made.costs)])

    for _ in range(50):
        look(0)
    needed = 0
    while min(range(5), key=made.costs.__getitem__) != 3:
        look(3)
        needed += 1
    assert 1 <= needed <= 10


def test_a_look_that_judges_only_some_models_changes_nothing() -> None:
    made = StepModels(PARAMETERS, LEAST_LEG_M, 0.2)
    before = made.costs
    made.judge([(0, 1.0)])
    made.judge([])
    assert made.costs == before


def test_slip_goes_down_the_slope_ahead_and_back() -> None:
    for forward in (0.05, -0.05):
        ahead, *_ = models(Motion(forward))
        assert ahead.step.y_m == pytest.approx(OWN.slip * 0.05)
