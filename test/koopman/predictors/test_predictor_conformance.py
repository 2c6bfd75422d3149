"""Conformance: what every predictor owes its users, whatever it is shown."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import case
from predictor_helpers import HISTORY, Timestep, forecasts, predictor, timesteps, whole
from robot_formation.koopman.predictors import DESCRIPTIONS, MODELS, NAMES, PredictionError, PredictorParameters
from robot_formation.koopman.predictors.predictor import EXPERTS, Forecast
from robot_formation.parameters import specs

pytestmark = pytest.mark.slow

PARTS = ("displacement", "residual", "commanded")
BOUND = np.array([0.1, 0.2, 0.35])
CLOSING = [name for name in NAMES if name.endswith("+close") or name == "formation"]


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_the_choices_of_the_parameter_are_the_models_there_are_and_those_with_closing() -> None:
    assert set(specs(PredictorParameters)["name"].choices) == set(NAMES) == set(DESCRIPTIONS)
    assert {name.removesuffix("+close") for name in NAMES if name not in EXPERTS} == set(MODELS)
    assert set(EXPERTS) == {"formation", "trend+close"}
    assert len(set(NAMES)) == len(NAMES) == 13


def test_a_misspelt_predictor_is_refused_with_the_near_name() -> None:
    with pytest.raises(PredictionError, match="no predictor 'mesured'; did you mean 'measured'"):
        predictor("mesured")
    with pytest.raises(PredictionError, match="no predictor 'literal\\+close'"):
        predictor("literal+close")


def test_nothing_can_be_predicted_from_nothing(name: str) -> None:
    with pytest.raises(PredictionError, match="no displacement was observed yet"):
        predictor(name).predict()


# --- forecasts that need no knowledge of the model ------------------------------------------------------------------


def test_without_residuals_the_first_forecast_is_the_first_displacement(name: str) -> None:
    # Of oscillators that were shown one displacement each has its own opinion: they are believed little at first.
    near = 0.004 if name == "formation" else 1e-5 if name in EXPERTS else 1e-15
    assert forecasts(name, [(0.013, 0.05)])[0] == pytest.approx([0.013, 0.05], abs=near)


@pytest.mark.parametrize("name", CLOSING)
def test_with_residuals_the_first_forecast_lies_between_the_leaders_step_and_what_was_seen(name: str) -> None:
    found = predictor(name)
    found.observe(whole((0.0, 0.06)), np.zeros(3))
    assert found.predict().mean[0] == pytest.approx(0.0, abs=1e-15)
    assert 0.05 < found.predict().mean[1] < 0.06


def test_a_constant_displacement_is_forecast_to_stay(name: str) -> None:
    history = [(0.013, 0.05)] * 40
    near = 1e-4 if name in EXPERTS else 1e-12
    assert forecasts(name, history)[20:] == pytest.approx(np.array(history)[20:], abs=near)


def test_a_robot_that_stands_is_forecast_to_stand(name: str) -> None:
    assert forecasts(name, [(0.0, 0.0)] * 40) == pytest.approx(np.zeros((40, 2)), abs=1e-12)


@pytest.mark.parametrize("name", CLOSING)
def test_a_constant_displacement_that_leaves_no_residual_is_found(name: str) -> None:
    found = predictor(name)
    for _ in range(40):
        found.observe(whole((0.013, 0.047)), np.zeros(3), whole((0.013, 0.047)))
    assert found.predict().mean == pytest.approx([0.013, 0.047, 0.0], abs=1e-4)
    assert found.predict().command == pytest.approx([0.013, 0.047, 0.0], abs=1e-4)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in EXPERTS])
def test_displacements_along_one_line_are_forecast_on_it(name: str) -> None:
    for u, v in ((0.0, 0.05), (0.05, 0.0), (0.013, -0.05)):
        found = forecasts(name, [(u * 0.95**n, v * 0.95**n) for n in range(20)])
        assert found[:, 0] * v == pytest.approx(found[:, 1] * u, abs=1e-12), (u, v)


# --- bounds ---------------------------------------------------------------------------------------------------------


def check(forecast: Forecast) -> None:
    for mean in (forecast.mean, forecast.command):
        assert mean.shape == (3,)
        assert np.isfinite(mean).all()
        assert (np.abs(mean) <= BOUND).all()
    for covariance in (forecast.covariance, forecast.about_command):
        assert np.isfinite(covariance).all()
        assert (covariance == covariance.T).all()
        assert np.linalg.eigvalsh(covariance).min() >= -1e-12


def pairs(u: float, v: float) -> st.SearchStrategy[Any]:
    return st.tuples(st.floats(-u, u), st.floats(-v, v), st.just(0.0) | st.floats(-3.5, 3.5)).map(np.array)


@pytest.mark.filterwarnings("error")
@settings(deadline=None, max_examples=40)
@given(
    history=st.lists(
        st.tuples(pairs(1.0, 2.0), st.none() | pairs(1.0, 2.0), st.none() | pairs(1.0, 2.0)), min_size=1, max_size=25
    )
)
@pytest.mark.parametrize("name", NAMES)
def test_forecasts_are_finite_and_bounded_and_their_covariance_is_one(name: str, history: list[Timestep]) -> None:
    for forgetting in (1.0, 0.7):
        found = predictor(name, forgetting=forgetting)
        for timestep in history:
            found.observe(*timestep)
            with case("forgetting", forgetting):
                check(found.predict())


AWKWARD = 40  # timesteps
KINDS = {
    "constant": [(0.013, 0.05)] * AWKWARD,
    "collinear": [(0.01 * 0.9**n, 0.05 * 0.9**n) for n in range(AWKWARD)],
    "zero": [(0.0, 0.0)] * AWKWARD,
    "huge": [(1.0, 2.0), (-1.0, 2.0), (1.0, -2.0), (1.0, 2.0)] * (AWKWARD // 4),
    "huge and constant": [(1.0, -2.0)] * AWKWARD,
    "tiny": [(1e-9, 0.0), (1e-200, 0.0), (0.0, 8e-178), (8e-178, 0.0), (0.0, 1e-320)] * (AWKWARD // 5),
    "growing": [(1e-3 * 1.16**n, -2e-3 * 1.16**n) for n in range(AWKWARD)],
}


@pytest.mark.filterwarnings("error")
def test_awkward_histories_give_bounded_forecasts(name: str) -> None:
    for kind, replaced in itertools.product(KINDS, [*((part,) for part in PARTS), PARTS]):
        found = predictor(name)
        for number, (odd, usual) in enumerate(zip(KINDS[kind], timesteps(AWKWARD), strict=True)):
            with case(kind, replaced, f"timestep {number}"):
                x, r, c = (whole(odd) if part in replaced else value for part, value in zip(PARTS, usual, strict=True))
                assert x is not None
                found.observe(x, r, c)
                check(found.predict())
                found.diagnostics()


@pytest.mark.filterwarnings("error")
def test_displacements_so_small_that_their_inverse_is_huge_do_no_harm(name: str) -> None:
    for first in ([(1e-9, 0.0)], [(1e-200, 0.0)], [(0.0, 8e-178), (8e-178, 0.0)], [(0.0, 0.0), (0.0, 1e-320)]):
        with case(first):
            found = forecasts(name, [*first, (0.1, 0.05), (0.05, 0.1), *[(0.01, 0.05)] * 60])
            assert (np.abs(found) <= BOUND[:2]).all()
            if name != "literal":
                assert found[-1] == pytest.approx([0.01, 0.05], abs=0.003)


# --- what is refused ------------------------------------------------------------------------------------------------


BAD = [
    (np.nan, 0.05, 0.0), (0.0, np.nan, 0.0), (np.inf, 0.0, 0.0), (0.0, -np.inf, 0.0), (1.01, 0.0, 0.0),
    (0.0, -2.01, 0.0), (1e300, 0.0, 0.0), (0.0, 0.05, np.inf), (0.0, 0.05, -3.6),
]  # fmt: skip


def test_absurd_input_is_refused_with_a_reason_and_changes_nothing(name: str) -> None:
    for part, seen in itertools.product(PARTS, (0, 1, 3, 6)):
        with case(part, f"after {seen} timesteps"):
            check_absurd_input(name, part, seen)


def check_absurd_input(name: str, part: str, seen: int) -> None:
    asked, twin = predictor(name), predictor(name)
    history = timesteps(9)
    for timestep in history[:seen]:
        asked.observe(*timestep)
        twin.observe(*timestep)
    for bad in BAD:
        values = [np.array(bad) if part == other else whole((0.01, 0.05)) for other in PARTS]
        with pytest.raises(PredictionError, match=f"refused the {part}.*(not finite|no robot goes so far)"):
            asked.observe(*values)
        assert asked.observations == seen
        assert asked.state() == twin.state()
    for timestep in history[seen:]:
        asked.observe(*timestep)
        twin.observe(*timestep)
    assert all((a == b).all() for a, b in zip(asked.predict(), twin.predict(), strict=True))


# --- determinism and ownership --------------------------------------------------------------------------------------


def test_the_same_history_gives_the_same_forecasts_to_the_last_bit(name: str) -> None:
    found = [predictor(name), predictor(name)]
    for timestep in timesteps(30):
        for either in found:
            either.observe(*timestep)
        assert all((a == b).all() for a, b in zip(found[0].predict(), found[1].predict(), strict=True))


def test_what_is_handed_in_stays_as_it_is_and_is_not_kept(name: str) -> None:
    asked, twin = predictor(name), predictor(name)
    for x, r, c in timesteps(20):
        mine = (x.copy(), None if r is None else r.copy(), None if c is None else c.copy())
        asked.observe(*mine)
        for value, before in zip(mine, (x, r, c), strict=True):
            if value is not None:
                assert (value == before).all()
                value[:] = np.nan
        twin.observe(x, r, c)
        assert (asked.predict().mean == twin.predict().mean).all()


def test_asking_twice_changes_nothing_and_the_answer_is_the_askers(name: str) -> None:
    found = predictor(name)
    for timestep in timesteps(20):
        found.observe(*timestep)
    first = found.predict()
    kept = [part.copy() for part in first]
    for part in first:
        part[:] = np.nan
    assert all((a == b).all() for a, b in zip(found.predict(), kept, strict=True))


# --- covariance -----------------------------------------------------------------------------------------------------


def test_the_covariance_is_the_mean_square_of_the_forecasts_own_errors_and_of_sigma(name: str) -> None:
    for known, discount in itertools.product((False, True), (1.0, 0.8)):
        with case("residuals known" if known else "residuals unknown", f"discount {discount}"):
            check_covariance(name, known, discount)


def check_covariance(name: str, known: bool, discount: float) -> None:
    sigmas = {"sigma_u_m": 0.004, "sigma_v_m": 0.003, "sigma_turn_rad": 0.02}
    found = predictor(name, **sigmas, sigma_weight=2.5, sigma_discount=discount)
    total, weight, expected = np.diag(list(sigmas.values())) ** 2 * 2.5, 2.5, None
    for x, r, c in timesteps(20):
        seen = r if known else None
        if expected is not None and not (known and seen is None):  # in a blind timestep nobody knows the error
            error = (x if seen is None else x + seen) - expected  # of the ideal move, where it is known
            total, weight = discount * total + np.outer(error, error), discount * weight + 1.0
        found.observe(x, seen, c)
        expected = found.predict().mean
        assert found.predict().covariance == pytest.approx(total / weight, abs=1e-18)


def test_the_second_moment_about_the_command_holds_the_bias_that_was_taken_off() -> None:
    found = predictor("formation")
    for timestep in timesteps(20):
        found.observe(*timestep)
    forecast = found.predict()
    bias = forecast.mean - forecast.command
    assert bias[0] > 0.001
    assert forecast.about_command - forecast.covariance == pytest.approx(np.outer(bias, bias))
    plain = predictor("measured")
    plain.observe(whole(HISTORY[0]))
    assert (plain.predict().about_command == plain.predict().covariance).all()


# --- diagnostics ------------------------------------------------------------------------------------------------


def test_diagnostics_show_k_with_its_eigenvalues_where_there_is_one(name: str) -> None:
    found = predictor(name)
    for x in HISTORY:
        found.observe(whole(x))
    diagnostics = found.diagnostics()
    size = {"measured": 2, "literal": 2, "edmd": 3, "formation": 9}.get(name.removesuffix("+close"))
    if size is None:
        assert (diagnostics.k, diagnostics.eigenvalues, diagnostics.condition_number) == (None, None, None)
        return
    assert diagnostics.k is not None
    assert diagnostics.eigenvalues is not None
    assert diagnostics.condition_number is not None
    assert diagnostics.k.shape == (size, size)
    assert np.sum(diagnostics.eigenvalues).real == pytest.approx(np.trace(diagnostics.k))
    assert np.prod(diagnostics.eigenvalues).real == pytest.approx(np.linalg.det(diagnostics.k), abs=1e-9)
    if size == 2:
        used = HISTORY[:2] if name == "literal" else HISTORY[:-1]
        assert diagnostics.condition_number == pytest.approx(np.linalg.cond(np.array(used)), rel=1e-6)
    assert diagnostics.condition_number > 1.0


@pytest.mark.parametrize("name", CLOSING)
def test_diagnostics_show_residual_and_bias_of_those_that_close_them(name: str) -> None:
    found = predictor(name)
    for timestep in timesteps(10):
        found.observe(*timestep)
    notes = found.diagnostics().notes
    assert notes is not None
    assert {"residual [m]", "actuation bias [m]"} <= set(notes)
    bias = found.predict().mean - found.predict().command
    assert notes["actuation bias [m]"] == np.array2string(bias[:2], precision=6, separator=", ")
