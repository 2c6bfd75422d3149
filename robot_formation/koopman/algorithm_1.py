"""Algorithm 1 of the paper as it is printed, for the record: it never learns.

The loop sets x_m+1 = y_m and y_m+1 = K_m y_m. So the innovation, by which K is to be corrected, is

    y_m+1 - K_m x_m+1 = K_m y_m - K_m y_m = 0

in exact arithmetic, and K_m+1 = K_m whatever the data: the loop computes the powers K_2^t y_2. Only P changes, which
nothing else uses then. Online DMD, where the recursion is taken from, pairs x_m+1 with the *measured* next state: see
`OnlineDMD`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, Vector, as_matrix


@dataclass(frozen=True, eq=False)
class Step:
    """The loop's variables after an iteration: K and P (n, n), its x, y and innovation y - K x (n,) with the old K."""

    k: Matrix
    p: Matrix
    x: Vector
    y: Vector
    innovation: Vector


def algorithm_1(displacements: ArrayLike, iterations: int) -> Iterator[Step]:
    """Run the paper's "Prediction algorithm" line by line.

    Args:
        displacements: the collection phase's, shape (n, m + 1); the paper has n = 2 components and m = 2 pairs.
        iterations: how often the loop runs.

    Yields:
        What the loop's start and then each iteration leaves; `y` is the forecast. The innovation of the start is zero.

    Raises:
        KoopmanError: if X X' has no inverse.
    """
    data = as_matrix(displacements, "the displacements")
    if data.shape[1] < 2:
        raise KoopmanError("Algorithm 1 needs at least two displacements")
    xs, ys = data[:, :-1], data[:, 1:]
    try:
        p = np.linalg.inv(xs @ xs.T)
    except np.linalg.LinAlgError as error:
        raise KoopmanError("Algorithm 1 can't start: the collected displacements are collinear") from error
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
