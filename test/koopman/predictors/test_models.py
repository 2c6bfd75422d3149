"""Every model's forecasts against hand calculation, numpy's least squares and a textbook Kalman filter."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from koopman_helpers import batch
from predictor_helpers import HISTORY, forecasts, predictor, solve_2_by_2, whole
from robot_formation.koopman.dictionaries import Dictionary
from robot_formation.koopman.predictors import NAMES
from robot_formation.koopman.predictors.dictionary_text import dictionary_from_text
from robot_formation.koopman.predictors.dmd import Edmd
from robot_formation.koopman.predictors.models import TrendFilter
from robot_formation.koopman.predictors.parameters import EdmdParameters, EwmaParameters, TrendParameters
from robot_formation.parameters import ParameterError

Array = npt.NDArray[np.float64]

WIDE = {"max_u_m": 10.0, "max_v_m": 10.0}


def test_previous_repeats_the_last_displacement() -> None:
    assert forecasts("previous", HISTORY) == pytest.approx(np.array(HISTORY), abs=0.0)


@pytest.mark.parametrize("gain", [0.0, 0.3, 1.0])
def test_ewma_weighs_displacements_by_age(gain: float) -> None:
    found = forecasts("ewma", HISTORY, ewma=EwmaParameters(gain=gain))
    for n in range(1, len(HISTORY) + 1):
        ages = np.arange(n - 1, -1, -1)
        weights = gain * (1.0 - gain) ** ages
        weights[0] = (1.0 - gain) ** (n - 1)  # the first displacement is the mean's start
        assert found[n - 1] == pytest.approx(weights @ np.array(HISTORY[:n]), abs=1e-15)


# --- literal and measured -------------------------------------------------------------------------------------------


def test_literal_takes_k_from_the_first_three_displacements_and_then_is_blind() -> None:
    x1, x2, x3 = map(np.array, HISTORY[:3])
    k = solve_2_by_2(x1, x2, x2, x3)
    expected = [x1, x2, k @ x3, k @ k @ x3, k @ k @ k @ x3, k @ k @ k @ k @ x3]
    found = forecasts("literal", HISTORY, **WIDE)
    assert found == pytest.approx(np.array(expected), rel=1e-9)
    other = [*HISTORY[:3], (-0.03, 0.01), (0.0, 0.0), (0.05, 0.05)]
    assert (forecasts("literal", other, **WIDE)[2:] == found[2:]).all()


def test_measured_fits_k_to_all_measured_pairs() -> None:
    found = forecasts("measured", HISTORY, **WIDE)
    assert found[:2] == pytest.approx(np.array(HISTORY[:2]), abs=0.0)  # collection: the previous displacement
    for n in range(3, len(HISTORY) + 1):
        xs, ys = np.array(HISTORY[: n - 1]), np.array(HISTORY[1:n])
        k = np.linalg.lstsq(xs, ys, rcond=None)[0].T
        assert found[n - 1] == pytest.approx(k @ ys[-1], abs=1e-9)
    x1, x2, x3 = map(np.array, HISTORY[:3])
    assert found[2] == pytest.approx(solve_2_by_2(x1, x2, x2, x3) @ x3, rel=1e-9)


def test_measured_and_literal_agree_until_there_is_something_to_learn() -> None:
    literal, measured = (forecasts(name, HISTORY) for name in ("literal", "measured"))
    assert literal[:3] == pytest.approx(measured[:3], rel=1e-9)
    assert not np.allclose(literal[3], measured[3], rtol=1e-3)


def test_measured_forgets_by_its_parameter() -> None:
    xs, ys = np.array(HISTORY[:-1]), np.array(HISTORY[1:])
    weights = np.sqrt(0.6) ** np.arange(len(xs) - 1, -1, -1)[:, None]
    k = np.linalg.lstsq(weights * xs, weights * ys, rcond=None)[0].T
    assert forecasts("measured", HISTORY, forgetting=0.6, **WIDE)[-1] == pytest.approx(k @ ys[-1], abs=1e-9)


@pytest.mark.parametrize("name", ["literal", "measured"])
def test_a_linear_law_is_forecast_exactly(name: str) -> None:
    k = np.array([[1.02, 0.03], [-0.05, 0.99]])
    history = [np.array([0.01, 0.05])]
    for _ in range(8):
        history.append(k @ history[-1])
    assert forecasts(name, history)[2:] == pytest.approx(np.array([k @ x for x in history[2:]]), abs=1e-9)


def test_diagnostics_of_measured_show_the_last_innovation() -> None:
    found = predictor("measured")
    for x in HISTORY[:-1]:
        found.observe(whole(x))
    k = found.diagnostics().k
    found.observe(whole(HISTORY[-1]))
    assert found.diagnostics().innovation == pytest.approx(np.array(HISTORY[-1]) - k @ np.array(HISTORY[-2]))


# --- the trend filter -----------------------------------------------------------------------------------------------


def textbook(p: TrendParameters, values: Array, start: tuple[float, float] | None = None) -> Array:
    """Kalman filter of one axis in the usual matrices; the predicted level after each value."""
    f = np.array([[1.0, p.damping], [0.0, p.damping]])
    q, h = np.diag([p.level_m**2, p.trend_m**2]), np.array([[1.0, 0.0]])
    r = np.array([[p.noise_m**2]])
    state, covariance, found = None, None, []
    if start is not None:
        state, covariance = np.array([start[0], 0.0]), np.diag([start[1] ** 2, p.start_trend_m**2])
    for value in values:
        if state is None:
            state, covariance = np.array([value, 0.0]), np.diag([p.noise_m**2, p.start_trend_m**2])
        else:
            gain = covariance @ h.T @ np.linalg.inv(h @ covariance @ h.T + r)
            state = state + gain @ (value - h @ state)
            covariance = (np.eye(2) - gain @ h) @ covariance
        state, covariance = f @ state, f @ covariance @ f.T + q
        found.append(state[0])
    return np.array(found)


@pytest.mark.parametrize("start", [None, (0.0, 0.008)])
def test_the_trend_filter_is_the_textbooks_kalman_filter(start: tuple[float, float] | None) -> None:
    p = TrendParameters()
    tested = TrendFilter(p)
    assert (tested.forecast() == 0.0).all()
    if start is not None:
        tested.start(np.full(2, start[0]), start[1])
    values = np.random.default_rng(3).normal((0.01, 0.05), 0.003, (30, 2))
    found = []
    for value in values:
        tested.observe(value)
        found.append(tested.forecast())
    for axis in (0, 1):
        assert np.array(found)[:, axis] == pytest.approx(textbook(p, values[:, axis], start), abs=1e-14)
    if start is None:
        assert forecasts("kalman_trend", values) == pytest.approx(np.array(found), abs=0.0)


def test_a_steady_trend_is_followed_and_a_jump_is_smoothed() -> None:
    ramp = [(0.0, 0.03 + 0.0005 * n) for n in range(60)]
    assert forecasts("kalman_trend", ramp)[-1][1] == pytest.approx(0.03 + 0.0005 * 60, abs=6e-4)
    step = [(0.0, 0.05)] * 10 + [(0.0, 0.06)]
    assert 0.05 < forecasts("kalman_trend", step)[-1][1] < 0.058


# --- EDMD with a dictionary -----------------------------------------------------------------------------------------

DICTIONARIES = ["constant identity", "identity", "constant monomials:3", "rbf:2 identity", "delay:2 constant"]


def lifted(text: str, history: Array, scale_m: float) -> tuple[Dictionary, Array]:
    psi = dictionary_from_text(text)
    rows: Array = psi(np.array(history).T / scale_m).T
    return psi, rows


@pytest.mark.parametrize("text", DICTIONARIES)
@pytest.mark.parametrize(("window", "forgetting"), [(0, 1.0), (0, 0.8), (7, 1.0)])
def test_edmd_is_the_batch_ridge_fit_towards_persistence(text: str, window: int, forgetting: float) -> None:
    rng = np.random.default_rng(1)
    history = rng.normal((0.01, 0.05), (0.01, 0.02), (20, 2))
    p = EdmdParameters(dictionary=text, prior=0.3, window=window, forgetting=forgetting)
    psi, rows = lifted(text, history, p.scale_m)
    k = batch(
        list(pairwise(rows)),
        forgetting=forgetting,
        prior_weight=0.3,
        prior_k=np.eye(psi.size),
        window=window or None,
    )
    expected = p.scale_m * (k[[row for row in psi.state_rows if row is not None]] @ rows[-1])
    assert forecasts("edmd", history, edmd=p, **WIDE)[-1] == pytest.approx(expected, abs=1e-9)


def test_edmd_finds_a_law_that_its_dictionary_holds() -> None:
    """v' = 0.02 + 0.6 v is affine: 'constant identity' has it, 'identity' alone hasn't."""
    history = [(0.0, 0.02)]
    for _ in range(25):
        history.append((0.0, 0.02 + 0.6 * history[-1][1]))
    later = 0.02 + 0.6 * history[6][1]
    errors = {}
    for text in ("constant identity", "identity"):
        p = EdmdParameters(dictionary=text, prior=1e-9)
        errors[text] = abs(forecasts("edmd", history[:7], edmd=p)[-1][1] - later)
    assert errors["constant identity"] < 1e-6 < errors["identity"]


def test_edmd_repeats_the_last_displacement_until_its_delays_are_filled() -> None:
    p = EdmdParameters(dictionary="delay:3")
    assert forecasts("edmd", HISTORY, edmd=p)[:3] == pytest.approx(np.array(HISTORY[:3]), abs=0.0)


def test_diagnostics_of_edmd_name_its_observables_and_the_innovation_in_metres() -> None:
    p = EdmdParameters(dictionary="constant monomials:2", prior=1.0)
    model = Edmd(p)
    assert model.diagnostics().innovation is None
    for x in HISTORY[:-1]:
        model.observe(np.array(x))
    expected = model.forecast()
    model.observe(np.array(HISTORY[-1]))
    diagnostics = model.diagnostics()
    assert diagnostics.innovation == pytest.approx(np.array(HISTORY[-1]) - expected, abs=1e-15)
    assert diagnostics.notes is not None
    assert diagnostics.notes["observables"] == "1, u, v, u^2, u v, v^2"


# --- dictionaries in words ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("identity", ("u", "v")),
        (" constant ,  identity ", ("1", "u", "v")),
        ("identity constant", ("u", "v", "1")),
        ("monomials:2", ("u", "v", "u^2", "u v", "v^2")),
        ("delay:1", ("u", "v", "u(t-1)", "v(t-1)")),
    ],
)
def test_words_become_observables_in_their_order(text: str, names: tuple[str, ...]) -> None:
    assert dictionary_from_text(text).names == names


def test_rbf_is_a_grid_that_reaches_twice_the_scale() -> None:
    psi = dictionary_from_text("identity rbf:3")
    assert psi.size == 2 + 9
    values = psi(np.array([[2.0], [-2.0]]))[2:, 0]
    assert values.max() == pytest.approx(1.0)  # a centre in the corner
    assert sorted(values)[-2] == pytest.approx(np.exp(-1.0))  # its neighbours are a width away
    assert dictionary_from_text("identity rbf:1")(np.zeros((2, 1)))[2, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the dictionary is empty"),
        (" , ", "the dictionary is empty"),
        ("constant", "doesn't contain the displacement: add 'identity'"),
        ("rbf:3", "doesn't contain the displacement"),
        ("identiti", "no dictionary 'identiti'; did you mean 'identity'?"),
        ("identity:2", "'identity' takes no number"),
        ("monomials", "'monomials' takes a number from 1 to 8, like 'monomials:2'"),
        ("monomials:0", "takes a number from 1 to 8"),
        ("monomials:9", "takes a number from 1 to 8"),
        ("monomials:two", "takes a number"),
        ("monomials:\u00b2", "takes a number"),
        ("delay:-1", "takes a number from 1 to 50"),
        ("identity rbf:11", "takes a number from 1 to 10"),
    ],
)
def test_wrong_words_are_refused_in_a_sentence(text: str, said: str) -> None:
    for make in (dictionary_from_text, lambda words: predictor("edmd", edmd=EdmdParameters(dictionary=words))):
        with pytest.raises(ParameterError) as refused:
            make(text)
        assert said in str(refused.value)
        assert "\n" not in str(refused.value)


def test_a_dictionary_that_is_not_used_is_not_looked_at() -> None:
    for name in NAMES:
        if not name.startswith("edmd"):
            predictor(name, edmd=EdmdParameters(dictionary="nonsense"))
