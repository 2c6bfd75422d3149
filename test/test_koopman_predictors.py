"""Every predictor's forecasts by hand, and what all of them owe their users."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.koopman.predictors import MODELS, NAMES, PredictionError, Predictor, PredictorParameters
from robot_formation.parameters import specs

HISTORY = [(0.010, 0.050), (0.012, 0.049), (0.015, 0.051), (0.017, 0.047), (0.021, 0.048), (0.022, 0.045)]


def predictor(name, **values):
    return Predictor(PredictorParameters(name=name, **values))


def forecasts(name, history, **values):
    """The forecast after each displacement."""
    found = predictor(name, **values)
    means = []
    for u, v in history:
        found.observe(np.array([u, v]))
        means.append(found.predict().mean)
    return np.array(means)


@pytest.fixture(params=sorted(NAMES))
def name(request):
    return request.param


def solve_2_by_2(x1, x2, y1, y2):
    """K with K x1 = y1 and K x2 = y2, by Cramer's rule."""
    det = x1[0] * x2[1] - x2[0] * x1[1]
    inverse = np.array([[x2[1], -x2[0]], [-x1[1], x1[0]]]) / det
    return np.column_stack([y1, y2]) @ inverse


def test_previous_repeats_the_last_displacement():
    assert forecasts("previous", HISTORY) == pytest.approx(np.array(HISTORY), abs=0.0)


def test_literal_takes_k_from_the_first_three_displacements_and_then_is_blind():
    x1, x2, x3 = map(np.array, HISTORY[:3])
    k = solve_2_by_2(x1, x2, x2, x3)
    expected = [x1, x2, k @ x3, k @ k @ x3, k @ k @ k @ x3, k @ k @ k @ k @ x3]
    wide = {"max_u_m": 10.0, "max_v_m": 10.0}
    found = forecasts("literal", HISTORY, **wide)
    assert found == pytest.approx(np.array(expected), rel=1e-9)
    other = [*HISTORY[:3], (-0.03, 0.01), (0.0, 0.0), (0.05, 0.05)]
    assert (forecasts("literal", other, **wide)[2:] == found[2:]).all()


def test_measured_fits_k_to_all_measured_pairs():
    found = forecasts("measured", HISTORY, max_u_m=10.0, max_v_m=10.0)
    assert found[:2] == pytest.approx(np.array(HISTORY[:2]), abs=0.0)  # collection: the previous displacement
    for n in range(3, len(HISTORY) + 1):
        xs, ys = np.array(HISTORY[: n - 1]), np.array(HISTORY[1:n])
        k = np.linalg.lstsq(xs, ys, rcond=None)[0].T
        assert found[n - 1] == pytest.approx(k @ ys[-1], abs=1e-9)
    x1, x2, x3 = map(np.array, HISTORY[:3])
    assert found[2] == pytest.approx(solve_2_by_2(x1, x2, x2, x3) @ x3, rel=1e-9)


def test_measured_and_literal_agree_until_there_is_something_to_learn():
    literal, measured = (forecasts(name, HISTORY) for name in ("literal", "measured"))
    assert literal[:3] == pytest.approx(measured[:3], rel=1e-9)
    assert not np.allclose(literal[3], measured[3], rtol=1e-3)


def test_measured_forgets_by_its_parameter():
    xs, ys = np.array(HISTORY[:-1]), np.array(HISTORY[1:])
    weights = np.sqrt(0.6) ** np.arange(len(xs) - 1, -1, -1)[:, None]
    k = np.linalg.lstsq(weights * xs, weights * ys, rcond=None)[0].T
    wide = {"max_u_m": 10.0, "max_v_m": 10.0}
    assert forecasts("measured", HISTORY, forgetting=0.6, **wide)[-1] == pytest.approx(k @ ys[-1], abs=1e-9)


@pytest.mark.parametrize("name", ["literal", "measured"])
def test_a_linear_law_is_forecast_exactly(name):
    k = np.array([[1.02, 0.03], [-0.05, 0.99]])
    history = [np.array([0.01, 0.05])]
    for _ in range(8):
        history.append(k @ history[-1])
    found = forecasts(name, history)
    assert found[2:] == pytest.approx(np.array([k @ x for x in history[2:]]), abs=1e-9)


def test_the_choices_of_the_parameter_are_the_models_there_are():
    assert set(specs(PredictorParameters)["name"].choices) == set(NAMES) >= set(MODELS)


def test_a_misspelt_predictor_is_refused_with_the_near_name():
    with pytest.raises(PredictionError, match="no predictor 'mesured'; did you mean 'measured'"):
        predictor("mesured")


# --- conformance: what every model owes ---------------------------------------------------------------------------


def test_nothing_can_be_predicted_from_nothing(name):
    with pytest.raises(PredictionError, match="no displacement was observed yet"):
        predictor(name).predict()


def test_the_first_forecast_is_the_first_displacement(name):
    assert forecasts(name, [(0.013, 0.05)])[0] == pytest.approx([0.013, 0.05], abs=0.0)


def test_a_constant_displacement_is_forecast_to_stay(name):
    history = [(0.013, 0.05)] * 40
    assert forecasts(name, history) == pytest.approx(np.array(history), abs=1e-12)


def test_a_robot_that_stands_is_forecast_to_stand(name):
    assert (forecasts(name, [(0.0, 0.0)] * 40) == 0.0).all()


@pytest.mark.parametrize(("u", "v"), [(0.0, 0.05), (0.05, 0.0), (0.013, -0.05)])
def test_displacements_along_one_line_are_forecast_on_it(name, u, v):
    history = [(u * 0.95**n, v * 0.95**n) for n in range(20)]
    found = forecasts(name, history)
    assert found[:, 0] * v == pytest.approx(found[:, 1] * u, abs=1e-12)
    growth = 1.0 if name == "previous" else 0.95
    assert found[2:] == pytest.approx(growth * np.array(history)[2:], abs=1e-12)


@pytest.mark.filterwarnings("error")
@settings(deadline=None, max_examples=60)
@given(history=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)), min_size=1, max_size=25))
@pytest.mark.parametrize("name", sorted(NAMES))
@pytest.mark.parametrize("forgetting", [1.0, 0.7])
def test_forecasts_are_finite_and_bounded_and_their_covariance_is_one(name, forgetting, history):
    found = predictor(name, forgetting=forgetting)
    for u, v in history:
        found.observe(np.array([u, v]))
        forecast = found.predict()
        assert forecast.mean.shape == (2,)
        assert np.isfinite(forecast.mean).all()
        assert (np.abs(forecast.mean) <= [0.1, 0.2]).all()
        assert (forecast.covariance == forecast.covariance.T).all()
        assert np.linalg.eigvalsh(forecast.covariance).min() >= -1e-12
        assert np.isfinite(forecast.covariance).all()


def test_the_largest_displacements_accepted_give_bounded_forecasts(name):
    found = forecasts(name, [(1.0, 2.0), (-1.0, 2.0), (1.0, -2.0), (1.0, 2.0)] * 5)
    assert (np.abs(found) <= [0.1, 0.2]).all()
    assert (np.abs(found[0]) == [0.1, 0.2]).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "first", [[(1e-9, 0.0)], [(1e-200, 0.0)], [(0.0, 8e-178), (8e-178, 0.0)], [(0, 0), (0, 1e-320)]]
)
def test_displacements_so_small_that_their_inverse_is_huge_do_no_harm(name, first):
    found = forecasts(name, [*first, (0.1, 0.05), (0.05, 0.1), *[(0.01, 0.05)] * 40])
    assert (np.abs(found) <= [0.1, 0.2]).all()
    if name != "literal":
        assert found[-1] == pytest.approx([0.01, 0.05], abs=0.003)


@pytest.mark.parametrize(
    "bad",
    [(np.nan, 0.05), (0.0, np.nan), (np.inf, 0.0), (0.0, -np.inf), (1.01, 0.0), (0.0, -2.01), (1e300, 0.0)],
    ids=str,
)
@pytest.mark.parametrize("seen", [0, 1, 2, 3, 5])
def test_absurd_displacements_are_refused_and_change_nothing(name, bad, seen):
    asked, twin = predictor(name), predictor(name)
    for either in (asked, twin):
        for u, v in HISTORY[:seen]:
            either.observe(u, v)
    with pytest.raises(PredictionError, match="refused the displacement"):
        asked.observe(*bad)
    assert asked.observations == seen
    for either in (asked, twin):
        for u, v in HISTORY[seen:]:
            either.observe(u, v)
    assert (asked.predict().mean == twin.predict().mean).all()
    assert (asked.predict().covariance == twin.predict().covariance).all()


def test_the_same_history_gives_the_same_forecasts_to_the_last_bit(name):
    assert (forecasts(name, HISTORY) == forecasts(name, HISTORY)).all()


def test_asking_twice_changes_nothing_and_the_answer_is_the_askers(name):
    found = predictor(name)
    for u, v in HISTORY:
        found.observe(np.array([u, v]))
    first = found.predict()
    kept = first.mean.copy(), first.covariance.copy()
    first.mean[:], first.covariance[:] = np.nan, np.nan
    again = found.predict()
    assert (again.mean == kept[0]).all()
    assert (again.covariance == kept[1]).all()


def test_the_covariance_is_the_mean_square_of_the_forecasts_own_errors_with_sigma_as_one_of_them(name):
    found = predictor(name, sigma_m=0.004)
    errors = [np.eye(2) * 0.004**2]
    expected = None
    for u, v in HISTORY:
        if expected is not None:
            error = np.array([u, v]) - expected
            errors.append(np.outer(error, error))
        found.observe(np.array([u, v]))
        expected = found.predict().mean
        assert found.predict().covariance == pytest.approx(np.mean(errors, axis=0), abs=1e-18)


def test_insight_shows_k_with_its_eigenvalues_where_there_is_one(name):
    found = predictor(name)
    assert found.insight().k is None
    assert found.insight().eigenvalues is None
    for u, v in HISTORY:
        found.observe(np.array([u, v]))
    insight = found.insight()
    if name == "previous":
        assert insight.k is None
        return
    assert insight.k.shape == (2, 2)
    assert np.sum(insight.eigenvalues).real == pytest.approx(np.trace(insight.k))
    assert np.prod(insight.eigenvalues).real == pytest.approx(np.linalg.det(insight.k))
    used = HISTORY[:2] if name == "literal" else HISTORY[:-1]
    assert insight.condition_number == pytest.approx(np.linalg.cond(np.array(used)), rel=1e-6)


def test_insight_of_measured_shows_the_last_innovation():
    found = predictor("measured")
    for u, v in HISTORY[:-1]:
        found.observe(np.array([u, v]))
    k = found.insight().k
    found.observe(*HISTORY[-1])
    assert found.insight().innovation == pytest.approx(np.array(HISTORY[-1]) - k @ np.array(HISTORY[-2]))
