"""Rows and columns are paired at the least cost, as SciPy does it; SciPy itself is not imported for it."""

import itertools
import math
import subprocess
import sys

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linear_sum_assignment

from robot_formation.vision.overhead.assignment import assign

Array = npt.NDArray[np.float64]


def tables(most: int, elements: st.SearchStrategy[float]) -> st.SearchStrategy[Array]:
    shapes = st.tuples(st.integers(1, most), st.integers(0, most))
    return shapes.flatmap(lambda shape: arrays(float, shape, elements=elements))


@given(tables(4, st.floats(0, 2)))
@settings(max_examples=60, deadline=None)
def test_the_assignment_is_the_cheapest_of_all(costs: Array) -> None:
    rows, columns = costs.shape
    found = assign(costs, 1.0)
    taken = [column for column in found if column is not None]
    assert len(set(taken)) == len(taken)
    assert all(column is None or costs[row, column] <= 1.0 for row, column in enumerate(found))
    paid = sum(1.0 if column is None else costs[row, column] for row, column in enumerate(found))

    def price(row: int, column: int) -> float:
        return 1.0 if column >= columns else costs[row, column] if costs[row, column] <= 1.0 else math.inf

    choices = itertools.permutations(range(columns + rows), rows)
    best = min(sum(price(row, column) for row, column in enumerate(choice)) for choice in choices)
    assert paid == pytest.approx(best, abs=1e-9)


# Of few different values: many ties.
@given(tables(11, st.one_of(st.floats(0, 2), st.sampled_from([0.0, 0.25, 0.5, 1.0, 2.0, math.inf]))))
@settings(max_examples=200, deadline=None)
def test_pairs_are_those_of_scipy_ties_included(costs: Array) -> None:
    rows, columns = costs.shape
    table = np.hstack([np.where(costs > 1.0, 1e6, costs), np.full((rows, rows), 1.0)])
    theirs = [int(column) if column < columns else None for column in linear_sum_assignment(table)[1]]
    assert assign(costs, 1.0) == theirs


def test_tracking_imports_no_scipy() -> None:
    code = "import sys, robot_formation.vision.overhead.dot_tracking; print('scipy' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told == "False\n"
