"""Displacement logs: what is read, what is refused and how it is said; one-step forecasts and their errors."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import ArrayLike, NDArray

from robot_formation.analysis.displacement_log import DisplacementLog, read_log, write_log
from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.forecasts import error_statistics, forecast_log, inside_ellipse
from robot_formation.analysis.quantiles import ELLIPSE_90
from robot_formation.koopman.predictors import NAMES, PredictorParameters

FULL = "u_m,v_m,residual_u_m,residual_v_m,commanded_u_m,commanded_v_m"


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str | bytes], Path]:
    path = tmp_path / "log.csv"

    def write(content: str | bytes) -> Path:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def log_of(
    displacements: ArrayLike, residuals: ArrayLike | None = None, commanded: ArrayLike | None = None
) -> DisplacementLog:
    displacements = np.array(displacements, dtype=float)
    unknown = np.full_like(displacements, np.nan)
    places = tuple(f"line {t + 2}" for t in range(len(displacements)))
    return DisplacementLog(
        "log.csv",
        places,
        displacements,
        unknown if residuals is None else np.array(residuals, dtype=float),
        unknown if commanded is None else np.array(commanded, dtype=float),
        np.zeros(len(displacements)),
    )


def test_a_log_of_displacements_alone_has_them_for_targets(file: Callable[[str | bytes], Path]) -> None:
    log = read_log(file("u_m,v_m\n0.01,0.05\n-0.02,5e-2\n"))
    np.testing.assert_array_equal(log.displacements_m, [[0.01, 0.05], [-0.02, 0.05]])
    np.testing.assert_array_equal(log.targets_m, log.displacements_m)
    assert log.places == ("line 2", "line 3")
    assert not log.has_residuals
    assert not log.has_commanded


def test_with_residuals_the_target_is_the_ideal_move(file: Callable[[str | bytes], Path]) -> None:
    log = read_log(file(f"{FULL}\n0.01,0.05,0.001,-0.002,0.02,0.06\n0.02,0.05,,,,\n"))
    np.testing.assert_allclose(log.targets_m, [[0.011, 0.048], [np.nan, np.nan]], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(log.commanded_m, [[0.02, 0.06], [np.nan, np.nan]])


@pytest.mark.parametrize(
    "content",
    [
        "v_m,note,u_m\n0.05,here,0.01\n",
        "\ufeffu_m,v_m\r\n0.01,0.05\r\n",
        "u_m,v_m\r0.01,0.05\r",
        '# recorded on Monday, by "us\n u_m , v_m \n\n# calm\n 0.01 , +0.05 \n   \n',
        'u_m,v_m,"a, b"\n0.01,"0.05","x, y"\n',
        "t,t,u_m,v_m\n1,1,.01,5.0E-2\n",
        "u_m,v_m,\n0.01,0.05,\n",
        "u_m,v_m\n0.01,0.05",
    ],
)
def test_what_is_harmless_is_read(file: Callable[[str | bytes], Path], content: str) -> None:
    log = read_log(file(content))
    np.testing.assert_array_equal(log.displacements_m, [[0.01, 0.05]])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["empty", "u_m,v_m"]),
        ("\n# nothing\n", ["empty"]),
        ("u_m,v_m\n", ["no rows"]),
        ("0.01,0.05\n0.02,0.05\n", ["line 1", "no column 'u_m'"]),
        ("u_m,w_m\n0.01,0.05\n", ["line 1", "no column 'v_m'", "'w_m'"]),
        ("u_m,v_m,residual_u_m\n0.01,0.05,0.0\n", ["line 1", "'residual_v_m'"]),
        ("u_m,v_m,commanded_v_m\n0.01,0.05,0.0\n", ["line 1", "'commanded_u_m'"]),
        ("# log\nu_m,v_m,u_m\n0.01,0.05,0.02\n", ["line 2", "'u_m'", "2 times"]),
        ("u_m;v_m\n0,01;0,05\n", ["line 1", "';'", "commas"]),
        ("u_m\tv_m\n0.01\t0.05\n", ["line 1", "commas"]),
        ("u_m,v_m\n0.01,0.05\n0.01\n", ["line 3", "2 columns", "has 1"]),
        ("u_m,v_m\n\n0.01,0.05,0.1\n", ["line 3", "has 3"]),
        ("u_m,v_m\n0.01,0.05\n,0.05\n", ["line 3", "u_m is empty"]),
        ("u_m,v_m\n0.01, \n", ["line 2", "v_m is empty"]),
        ("u_m,v_m,residual_u_m,residual_v_m\n0.01,0.05,0.01,\n", ["line 2", "residual_v_m is empty"]),
        ("u_m,v_m\n0.01,five\n", ["line 2", "v_m", "'five'", "no number"]),
        ("u_m,v_m\n0.01,1_0\n", ["line 2", "'1_0'", "no number"]),
        ("u_m,v_m\n0.01,0x1\n", ["line 2", "no number"]),
        ("u_m,v_m\nnan,0.05\n", ["line 2", "u_m", "not finite"]),
        ("u_m,v_m\n0.01,-Infinity\n", ["line 2", "not finite"]),
        ("u_m,v_m\n0.01,1e999\n", ["line 2", "not finite"]),
        ('u_m,v_m\n0.01,"0.05\n', ["line 2", "no CSV"]),
        (b"u_m,v_m\n\xff\xfe,0.05\n", ["UTF-8"]),
        (b"\x89MCAP0\r\n\x01\xf0\x00", ["UTF-8", "--bag"]),
        ("u_m,v_m\n0.01," + "9" * 200_000 + "\n", ["line 2"]),
        ("u_m,v_m\n0.01," + "x" * 1000 + "\n", ["line 2", "no number"]),
    ],
)
def test_what_is_wrong_is_named_with_its_line_in_one_sentence(
    file: Callable[[str | bytes], Path], content: bytes | str, words: list[str]
) -> None:
    path = file(content)
    with pytest.raises(AnalysisError) as caught:
        read_log(path)
    text = str(caught.value)
    for word in [str(path), *words]:
        assert word in text
    assert "\n" not in text
    assert len(text) < len(str(path)) + 200


def test_a_file_that_is_not_there_or_a_folder_is_said(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "missing.csv"):
        with pytest.raises(AnalysisError, match="can't be read"):
            read_log(path)


@given(st.binary(max_size=200))
def test_whatever_is_in_a_file_it_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(b"u_m,v_m\n" + content)
    try:
        log = read_log(path)
    except AnalysisError:
        return
    assert np.isfinite(log.displacements_m).all()


PAIRS = arrays(float, st.tuples(st.integers(1, 8), st.just(2)), elements=st.floats(-1.0, 1.0))


@given(PAIRS, st.booleans(), st.booleans())
def test_what_was_written_is_read_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, values: NDArray[np.float64], residuals: bool, commanded: bool
) -> None:
    gaps = values.copy()
    gaps[1::2] = np.nan
    log = log_of(values, gaps if residuals else None, gaps if commanded else None)
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_log(log, path)
    back = read_log(path)
    for name in ("displacements_m", "residuals_m", "commanded_m"):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))


def test_a_log_is_never_written_over_another_file(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("precious")
    with pytest.raises(AnalysisError, match="exists already"):
        write_log(log_of([[0.0, 0.05]]), tmp_path / "log.csv")
    assert (tmp_path / "log.csv").read_text() == "precious"
    with pytest.raises(AnalysisError, match="can't be written"):
        write_log(log_of([[0.0, 0.05]]), tmp_path / "nowhere" / "log.csv")


def wandering(count: int, seed: int = 5) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.array([0.0, 0.05]) + rng.normal(0.0, 0.004, (count, 2))


def test_previous_forecasts_the_row_before() -> None:
    log = log_of(wandering(12))
    forecasts = forecast_log(log, PredictorParameters(name="previous"))
    assert np.isnan(forecasts.means_m[0]).all()
    np.testing.assert_array_equal(forecasts.means_m[1:], log.displacements_m[:-1])


def test_literal_forecasts_powers_of_the_first_fit_whatever_follows() -> None:
    x = np.array([[0.010, 0.050], [0.008, 0.052], [0.011, 0.049], [0.3, 0.3], [-0.3, 0.3], [0.0, 0.0]])
    k = x[1:3].T @ np.linalg.inv(x[:2].T)
    expected = [np.linalg.matrix_power(k, n) @ x[2] for n in (1, 2, 3)]
    forecasts = forecast_log(log_of(x), PredictorParameters(name="literal", max_u_m=1.0, max_v_m=1.0))
    np.testing.assert_allclose(forecasts.means_m[3:], expected, rtol=1e-9)


def test_measured_forecasts_by_the_least_squares_fit_of_all_pairs_before() -> None:
    x = wandering(15)
    forecasts = forecast_log(log_of(x), PredictorParameters(name="measured"))
    for t in range(3, 15):
        k = np.linalg.lstsq(x[: t - 1], x[1:t], rcond=None)[0].T
        np.testing.assert_allclose(forecasts.means_m[t], k @ x[t - 1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_a_forecast_is_made_from_the_rows_before_it_only(name: str) -> None:
    x, r, c = wandering(10), wandering(10, 6) - [0.0, 0.05], wandering(10, 7)
    known = forecast_log(log_of(x, r, c), PredictorParameters(name=name))
    changed = [values.copy() for values in (x, r, c)]
    for values in changed:
        values[6:] += 0.02
    other = forecast_log(log_of(*changed), PredictorParameters(name=name))
    np.testing.assert_array_equal(known.means_m[:7], other.means_m[:7])
    np.testing.assert_array_equal(known.covariances_m2[:7], other.covariances_m2[:7])


def test_a_row_that_a_predictor_refuses_is_named() -> None:
    with pytest.raises(AnalysisError, match=r"log\.csv, line 4: refused the displacement .* raise predictor\.max_u_m"):
        forecast_log(log_of([[0.0, 0.05], [0.0, 0.05], [0.0, 1e300]]), PredictorParameters(name="previous"))
    with pytest.raises(AnalysisError, match=r"line 3: refused the residual"):
        forecast_log(
            log_of([[0.0, 0.05], [0.0, 0.05]], [[0.0, 0.0], [0.0, -50.0]]), PredictorParameters(name="previous")
        )


def test_errors_are_summed_up_as_defined() -> None:
    errors = np.array([[np.nan, np.nan], [0.003, 0.004], [0.0, 0.0], [-0.006, 0.008], [np.nan, 0.1]])
    covariances = np.broadcast_to(np.eye(2) * 0.003**2, (5, 2, 2))
    found = error_statistics(errors, covariances)
    assert found["n"] == 3
    assert found["rmse_u"] == pytest.approx(math.sqrt((9 + 36) / 3) * 1e-3)
    assert found["rmse_v"] == pytest.approx(math.sqrt((16 + 64) / 3) * 1e-3)
    assert found["rmse"] == pytest.approx(math.sqrt((25 + 100) / 3) * 1e-3)
    assert found["median"] == pytest.approx(0.005)
    assert found["worst"] == pytest.approx(0.010)
    assert found["coverage_90"] == pytest.approx(2 / 3)  # 25 / 9 < 4.605 < 100 / 9


def test_without_errors_there_are_no_statistics() -> None:
    found = error_statistics(np.full((1, 2), np.nan), np.full((1, 2, 2), np.nan))
    assert found.pop("n") == 0
    assert set(found.values()) == {None}


def test_timesteps_without_a_residual_count_for_no_error_in_a_log_that_has_residuals() -> None:
    x, r = wandering(8), np.zeros((8, 2))
    r[3] = np.nan
    forecasts = forecast_log(log_of(x, r), PredictorParameters(name="previous"))
    assert forecasts.error_m["n"] == 6
    assert np.isfinite(forecasts.means_m[1:]).all()


@given(
    arrays(float, (2,), elements=st.floats(-0.05, 0.05)),
    st.floats(1e-3, 0.05),
    st.floats(1e-3, 0.05),
    st.floats(-0.95, 0.95),
)
def test_the_ellipse_is_that_of_the_inverse_covariance(
    error: NDArray[np.float64], sigma_u: float, sigma_v: float, correlation: float
) -> None:
    mixed = correlation * sigma_u * sigma_v
    covariance = np.array([[sigma_u**2, mixed], [mixed, sigma_v**2]])
    size = error @ np.linalg.solve(covariance, error)
    if abs(size - ELLIPSE_90) > 1e-6:
        assert inside_ellipse(error[None], covariance[None])[0] == (size < ELLIPSE_90)


def test_a_covariance_of_zero_holds_only_an_error_of_zero() -> None:
    assert inside_ellipse(np.array([[0.0, 0.0], [0.0, 1e-6]]), np.zeros((2, 2, 2))).tolist() == [True, False]


def test_nine_in_ten_normal_errors_lie_inside() -> None:
    rng = np.random.default_rng(1)
    covariance = np.array([[4e-6, 1e-6], [1e-6, 1e-6]])
    errors = rng.multivariate_normal(np.zeros(2), covariance, 20_000)
    share = inside_ellipse(errors, np.broadcast_to(covariance, (20_000, 2, 2))).mean()
    assert share == pytest.approx(0.9, abs=0.01)
