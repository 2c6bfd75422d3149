"""Which row gets which column at the least total cost: robots and dots.

SciPy's `linear_sum_assignment` gives the same pairs (a test compares), but importing it takes 0.3 s and 25 MB, and the
tables here have a few rows. The method is SciPy's too: shortest augmenting paths (D. F. Crouse, On implementing 2D
rectangular assignment algorithms, IEEE Transactions on Aerospace and Electronic Systems 52, 2016), ties included.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_FORBIDDEN = 1e6
"""Price of a pair that may not be, in prices of staying apart: no sum of allowed ones comes near it."""


def assign(costs: NDArray[np.float64], limit: float) -> list[int | None]:
    """Pair rows with columns at the least total cost; a pair dearer than `limit` stays apart, at that price.

    Args:
        costs: (rows, columns), may be without columns.
        limit: price of a row without column.

    Returns:
        Each row's column, or None.
    """
    rows, columns = costs.shape
    allowed = np.where(costs > limit, _FORBIDDEN * limit, costs)
    solver = _Solver([[*row, *([limit] * rows)] for row in allowed.tolist()])
    return [column if column < columns else None for column in solver.solve()]


class _Solver:
    """Pairs every row of a table with a column of its own; no fewer columns than rows.

    The paths are shortest in costs less the prices of row and column, which keep these from being negative.
    """

    def __init__(self, table: list[list[float]]) -> None:
        self._table = table
        self._columns = len(table[0]) if table else 0
        self._row_prices, self._column_prices = [0.0] * len(table), [0.0] * self._columns
        self._column_of, self._row_of = [-1] * len(table), [-1] * self._columns

    def solve(self) -> list[int]:
        """Return each row's column."""
        for row in range(len(self._table)):
            self._add(row)
        return self._column_of

    def _add(self, row: int) -> None:
        """Give one more row a column; others may get another one."""
        before, lengths, reached, length = self._shortest_path(row)
        self._row_prices[row] += length
        for column in reached[:-1]:
            self._row_prices[self._row_of[column]] += length - lengths[column]
        for column in reached:
            self._column_prices[column] -= length - lengths[column]
        column = reached[-1]
        while column >= 0:
            owner = before[column]
            self._row_of[column] = owner
            self._column_of[owner], column = column, self._column_of[owner]

    def _shortest_path(self, row: int) -> tuple[list[int], list[float], list[int], float]:
        """Find the way from a row to a free column.

        Returns:
            Of each column the row before it, and the length of the way to it; the columns that were reached, the free
            one last; the whole length.
        """
        before, lengths = [-1] * self._columns, [math.inf] * self._columns
        left, reached, length = list(range(self._columns - 1, -1, -1)), list[int](), 0.0
        while True:
            nearest, lowest = -1, math.inf
            for place, column in enumerate(left):
                found = length + self._table[row][column] - self._row_prices[row] - self._column_prices[column]
                if found < lengths[column]:
                    before[column], lengths[column] = row, found
                free = self._row_of[column] < 0
                if lengths[column] < lowest or (lengths[column] == lowest and free):
                    nearest, lowest = place, lengths[column]
            column, length = left[nearest], lowest
            reached.append(column)
            if self._row_of[column] < 0:
                return before, lengths, reached, length
            row = self._row_of[column]
            left[nearest] = left[-1]
            left.pop()
