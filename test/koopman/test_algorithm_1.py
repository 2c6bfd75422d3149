"""Algorithm 1 of the paper as it is printed never learns: its innovation is zero, see docs/explanation/koopman.md."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from predictor_helpers import forecasts

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Step:
    """The loop's variables after an iteration: K and P (n, n), its x, y and innovation y - K x (n,) with the old K."""

    k: Array
    p: Array
    x: Array
    y: Array
    innovation: Array


def algorithm_1(displacements: Array, iterations: int) -> Iterator[Step]:
    """Run the paper's "Prediction algorithm" line by line; yields what its start and then each iteration leaves."""
    data = np.asarray(displacements)
    xs, ys = data[:, :-1], data[:, 1:]
    p = np.linalg.inv(xs @ xs.T)
    k = ys @ np.linalg.pinv(xs)
    x, y = xs[:, -1], ys[:, -1]
    yield Step(k, p, x, y, np.zeros_like(y))
    for _ in range(iterations):
        x, y = y, k @ y
        innovation = y - k @ x
        gain = x @ p / (1.0 + x @ p @ x)
        k = k + np.outer(innovation, gain)
        p = p - np.outer(p @ x, gain)
        yield Step(k, p, x, y, innovation)


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


def test_the_predictor_literal_forecasts_the_same() -> None:
    data = np.array([(0.010, 0.050), (0.012, 0.049), (0.015, 0.051)])
    found = forecasts("literal", [*data, *np.zeros((5, 2))], max_u_m=10.0, max_v_m=10.0)
    for step, forecast in zip(list(algorithm_1(data.T, 6))[1:], found[2:], strict=True):
        assert forecast == pytest.approx(step.y, rel=1e-9)
