"""Algorithm 1 of the paper, taken literally, never learns."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_formation.koopman.algorithm_1 import algorithm_1
from robot_formation.koopman.linear_algebra import KoopmanError


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), dimension=st.integers(1, 4))
def test_the_literal_innovation_is_zero_and_k_never_changes(seed: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    base = np.linalg.qr(rng.normal(size=(dimension + 1, dimension + 1)))[0][:dimension]
    steps = list(algorithm_1(base + rng.normal(0.0, 0.05, base.shape), 20))
    assert len(steps) == 21
    for step in steps:
        assert (step.innovation == 0.0).all()
        assert (step.k == steps[0].k).all()


def test_the_literal_forecasts_are_powers_of_the_first_k() -> None:
    data = np.random.default_rng(1).normal(size=(2, 3))
    k = data[:, 1:] @ np.linalg.inv(data[:, :-1])
    for power, step in enumerate(algorithm_1(data, 6)):
        assert step.y == pytest.approx(np.linalg.matrix_power(k, power) @ data[:, 2])


def test_only_p_changes() -> None:
    first, *_, last = algorithm_1(np.random.default_rng(2).normal(size=(2, 3)), 5)
    assert np.linalg.norm(last.p) < np.linalg.norm(first.p)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (np.ones((2, 3)), "collinear"),
        (np.zeros((2, 3)), "collinear"),
        (np.ones((2, 1)), "at least two displacements"),
        (np.full((2, 3), np.nan), "finite"),
    ],
)
def test_displacements_that_it_cannot_start_from_are_refused(data: npt.NDArray[np.float64], message: str) -> None:
    with pytest.raises(KoopmanError, match=message):
        next(algorithm_1(data, 1))
