"""Online DMD equals batch least squares, recovers what is known, and survives data that say nothing."""

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robot_formation.koopman.online_dmd import OnlineDMD

Array = npt.NDArray[np.float64]

KNOWN = np.array([[0.9, 0.2], [-0.1, 0.8]])
unit = st.floats(-1.0, 1.0, allow_subnormal=False)


def batch(pairs: Sequence[tuple[Array, Array]], forgetting: float = 1.0) -> Array:
    """Weighted least squares of y = K x by numpy's lstsq; the newest pair has weight 1."""
    weights = np.sqrt(forgetting) ** np.arange(len(pairs) - 1, -1, -1)
    xs = np.array([x for x, _ in pairs]) * weights[:, None]
    ys = np.array([y for _, y in pairs]) * weights[:, None]
    fitted: Array = np.linalg.lstsq(xs, ys, rcond=None)[0].T
    return fitted


@st.composite
def well_conditioned_pairs(draw: st.DrawFn, dimension: int) -> list[tuple[Array, Array]]:
    """Pairs whose first n xs are the unit vectors, disturbed a little; later ones are arbitrary."""
    count = draw(st.integers(dimension, dimension + 12))
    xs = draw(arrays(float, (count, dimension), elements=unit))
    xs[:dimension] = np.eye(dimension) + 0.3 * xs[:dimension] / dimension
    ys = draw(arrays(float, (count, dimension), elements=unit))
    return list(zip(xs, ys, strict=True))


@pytest.mark.parametrize("dimension", [1, 2, 5])
@pytest.mark.parametrize("forgetting", [1.0, 0.95, 0.7])
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_k_equals_batch_least_squares_after_every_update(
    dimension: int, forgetting: float, data: st.DataObject
) -> None:
    pairs = data.draw(well_conditioned_pairs(dimension))
    dmd = OnlineDMD(dimension, forgetting=forgetting)
    for number, (x, y) in enumerate(pairs, start=1):
        dmd.update(x, y)
        assert dmd.started == (number >= dimension)
        assert dmd.k == pytest.approx(batch(pairs[:number], forgetting), abs=1e-9)


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
def test_k_equals_batch_least_squares_in_a_long_run_of_displacements(forgetting: float) -> None:
    rng = np.random.default_rng(3)
    xs = np.array([0.01, 0.05]) + rng.normal(0.0, 0.01, (200, 2))
    pairs = list(itertools.pairwise(xs))
    dmd = OnlineDMD(2, forgetting=forgetting)
    for number, (x, y) in enumerate(pairs, start=1):
        dmd.update(x, y)
        assert dmd.k == pytest.approx(batch(pairs[:number], forgetting), abs=1e-9)


@settings(deadline=None, max_examples=50)
@given(start=arrays(float, 2, elements=st.floats(0.1, 1.0)), forgetting=st.sampled_from([1.0, 0.9]))
def test_a_linear_system_is_recovered_from_its_trajectory(start: Array, forgetting: float) -> None:
    dmd = OnlineDMD(2, forgetting=forgetting)
    x = start
    for _ in range(12):
        dmd.update(x, KNOWN @ x)
        x = KNOWN @ x
    assert dmd.k == pytest.approx(KNOWN, abs=1e-8)
    assert np.sort_complex(np.linalg.eigvals(dmd.k)) == pytest.approx(
        np.sort_complex(np.linalg.eigvals(KNOWN)), abs=1e-7
    )


def test_the_slow_manifold_is_linear_in_its_three_observables() -> None:
    # x1' = mu x1, x2' = lambda (x2 - x1^2), observed by (x1, x2, x1^2): eigenvalues mu, lambda, 2 mu.
    mu, lam, dt = -0.2, -1.0, 0.1
    a, b = np.exp(mu * dt), np.exp(lam * dt)
    slope = lam / (lam - 2 * mu)  # x2 - slope x1^2 decays with lambda
    dmd = OnlineDMD(3)
    rng = np.random.default_rng(0)
    for _ in range(30):
        x1, x2 = rng.uniform(-1, 1, 2)
        y1, y2 = a * x1, slope * (a * x1) ** 2 + b * (x2 - slope * x1**2)
        dmd.update(np.array([x1, x2, x1**2]), np.array([y1, y2, y1**2]))
    found = np.sort(np.log(np.linalg.eigvals(dmd.k).real) / dt)
    assert found == pytest.approx(sorted([mu, lam, 2 * mu]), abs=1e-8)


def test_a_change_of_the_system_is_followed_with_forgetting_and_averaged_without() -> None:
    rng = np.random.default_rng(1)
    keeps, forgets = OnlineDMD(2), OnlineDMD(2, forgetting=0.8)
    for truth in (KNOWN, -KNOWN):
        for x in rng.normal(size=(60, 2)):
            keeps.update(x, truth @ x)
            forgets.update(x, truth @ x)
    assert forgets.k == pytest.approx(-KNOWN, abs=1e-4)
    assert np.abs(keeps.k).max() < 0.3


def test_algorithm_1_as_printed_feeds_on_its_own_forecast_and_never_learns() -> None:
    dmd = OnlineDMD(2)
    dmd.update(np.array([0.010, 0.050]), np.array([0.012, 0.049]))
    dmd.update(np.array([0.012, 0.049]), np.array([0.015, 0.051]))
    first, x = dmd.k.copy(), np.array([0.015, 0.051])
    for _ in range(15):
        forecast = dmd.k @ x
        assert dmd.update(x, forecast) == pytest.approx(0.0, abs=1e-15)
        x = forecast
    assert dmd.k == pytest.approx(first, abs=1e-9)


def test_the_innovation_is_that_of_the_k_before_the_update() -> None:
    dmd = OnlineDMD(2)
    for x in np.eye(2):
        dmd.update(x, KNOWN @ x)
    innovation = dmd.update(np.array([1.0, 1.0]), np.array([2.0, 3.0]))
    assert innovation == pytest.approx(np.array([2.0, 3.0]) - KNOWN @ np.ones(2))


@pytest.mark.parametrize(
    ("x", "y"),
    [
        ([np.nan, 1.0], [1.0, 1.0]),
        ([1.0, 1.0], [1.0, np.nan]),
        ([np.inf, 1.0], [1.0, 1.0]),
        ([1.0, 1.0], [-np.inf, 1.0]),
        ([1.0], [1.0, 1.0]),
        ([1.0, 1.0], [1.0, 1.0, 1.0]),
        ([[1.0, 1.0]], [1.0, 1.0]),
    ],
)
@pytest.mark.parametrize("started", [False, True])
def test_pairs_that_are_not_finite_or_of_the_wrong_shape_are_refused_and_nothing_is_learned(
    x: list[float | list[float]], y: list[float], started: bool
) -> None:
    dmd, twin = OnlineDMD(2), OnlineDMD(2)
    for either in (dmd, twin):
        for vector in np.eye(2)[: 2 if started else 1]:
            either.update(vector, KNOWN @ vector)
    with pytest.raises(ValueError, match="two finite vectors of length 2"):
        dmd.update(np.array(x), np.array(y))
    assert (dmd.k == twin.k).all()
    for either in (dmd, twin):
        either.update(np.array([0.3, 0.4]), np.array([0.5, 0.6]))
    assert (dmd.k == twin.k).all()


@pytest.mark.parametrize(("dimension", "forgetting"), [(0, 1.0), (2, 0.0), (2, 1.1), (2, -0.5), (2, np.nan)])
def test_a_dimension_or_forgetting_factor_that_makes_no_sense_is_refused(dimension: int, forgetting: float) -> None:
    with pytest.raises(ValueError, match="dimension of at least 1 and a forgetting factor"):
        OnlineDMD(dimension, forgetting=forgetting)


DIRECTION = np.array([0.013, 0.05])
POOR = {
    "constant": [DIRECTION] * 30,
    "collinear": [DIRECTION * (1.0 + 0.1 * np.sin(n)) for n in range(30)],
    "zero": [np.zeros(2)] * 30,
    "collinear with zeros": [DIRECTION * (n % 3) for n in range(30)],
    "tiny": [np.array([0.0, 8e-178]), np.array([8e-178, 0.0])] * 5,
    "rounded collinear": [DIRECTION * 0.9**n + 1e-14 * np.sin([n, 2.0 * n]) for n in range(30)],
}


@pytest.mark.parametrize("forgetting", [1.0, 0.8])
@pytest.mark.parametrize("history", POOR.values(), ids=POOR.keys())
def test_data_without_full_rank_give_the_finite_pseudo_inverse_solution(
    history: list[Array], forgetting: float
) -> None:
    dmd = OnlineDMD(2, forgetting=forgetting)
    for number, (x, y) in enumerate(itertools.pairwise(history), start=1):
        dmd.update(x, y)
        assert not dmd.started
        assert dmd.condition_number == float("inf")
        weights = np.sqrt(forgetting) ** np.arange(number - 1, -1, -1)
        xs, ys = np.array(history[:number]).T * weights, np.array(history[1 : number + 1]).T * weights
        assert dmd.k == pytest.approx(ys @ np.linalg.pinv(xs, rcond=1e-7), abs=1e-9)
        assert np.abs(dmd.k).max() < 10.0


def test_poor_data_then_rich_data_start_the_recursion_with_all_pairs() -> None:
    pairs = [(DIRECTION, KNOWN @ DIRECTION)] * 5 + [(np.array([0.02, -0.01]), np.array([0.01, 0.03]))]
    dmd = OnlineDMD(2)
    for x, y in pairs:
        dmd.update(x, y)
    assert dmd.started
    assert dmd.k == pytest.approx(batch(pairs), abs=1e-9)


@pytest.mark.parametrize("x", [np.zeros(2), DIRECTION], ids=["zero", "constant"])
@pytest.mark.parametrize("forgetting", [0.01, 0.5, 0.99])
@pytest.mark.filterwarnings("error")
def test_a_direction_that_is_never_excited_again_does_not_wind_p_up(forgetting: float, x: Array) -> None:
    dmd = OnlineDMD(2, forgetting=forgetting)
    for vector in np.eye(2):
        dmd.update(vector, KNOWN @ vector)
    for _ in range(2000):
        dmd.update(x, KNOWN @ x)
    assert dmd.k == pytest.approx(KNOWN, abs=1e-6)
    assert np.isfinite(dmd.condition_number)
    for vector in np.random.default_rng(0).normal(size=(200, 2)):  # and it can learn again
        dmd.update(vector, -KNOWN @ vector)
    if forgetting < 0.99:
        assert dmd.k == pytest.approx(-KNOWN, abs=1e-6)


def test_the_condition_number_is_that_of_the_data() -> None:
    rng = np.random.default_rng(5)
    xs = rng.normal(size=(20, 3))
    dmd = OnlineDMD(3)
    for x in xs:
        dmd.update(x, x)
    assert dmd.condition_number == pytest.approx(np.linalg.cond(xs), rel=1e-6)
