"""Checked input, and least squares that survive any finite data: what the parts of this package share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.errors import FormationError

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
ComplexMatrix = NDArray[np.complex128]


class KoopmanError(FormationError):
    """Data or settings that no model can be made of; the text says which and why. Nothing was learned from them."""


def as_matrix(value: ArrayLike, what: str, rows: int | None = None, columns: int | None = None) -> Matrix:
    """Return a finite matrix of floats, of the given shape where one is given.

    Raises:
        KoopmanError: if it is none.
    """
    matrix = _floats(value, what)
    if matrix.ndim != 2 or (rows is not None and matrix.shape[0] != rows):
        wanted = "" if rows is None else f" with {rows} row{'s' * (rows != 1)}"
        raise KoopmanError(f"{what} must be a matrix{wanted}, one column per snapshot, not of shape {matrix.shape}")
    if columns is not None and matrix.shape[1] != columns:
        raise KoopmanError(f"{what} must have {columns} column{'s' * (columns != 1)}, not {matrix.shape[1]}")
    return matrix


def as_vector(value: ArrayLike, what: str, length: int) -> Vector:
    """Return a finite vector of floats of a length.

    Raises:
        KoopmanError: if it is none.
    """
    vector = _floats(value, what)
    if vector.shape != (length,):
        raise KoopmanError(f"{what} must be a vector of length {length}, not of shape {vector.shape}")
    return vector


def _floats(value: ArrayLike, what: str) -> Matrix:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise KoopmanError(f"{what} must hold real numbers only: {error}") from error
    if not np.isfinite(array).all():
        raise KoopmanError(f"{what} must be finite, but it holds infinity or NaN")
    return array


def check_finite(array: Matrix | ComplexMatrix, what: str) -> None:
    """Refuse a result that overflowed.

    Raises:
        KoopmanError: if an element is not finite.
    """
    if not np.isfinite(array).all():
        raise KoopmanError(f"{what} overflows: scale the data to smaller numbers, or use fewer steps or lower degrees")


def singular_values(a: Matrix) -> tuple[Matrix, Vector, Matrix]:
    """Thin singular value decomposition (U, s, V') of a finite matrix.

    Raises:
        KoopmanError: if it overflows or does not converge.
    """
    try:
        u, s, vt = np.linalg.svd(a, full_matrices=False)
    except np.linalg.LinAlgError as error:
        raise KoopmanError(f"the singular value decomposition failed ({error}): scale the data") from error
    check_finite(s, "the singular value decomposition")
    return u, s, vt


@dataclass(frozen=True)
class Regularization:
    """How a least-squares fit is kept from trusting directions that the data hardly show.

    Attributes:
        ridge: Tikhonov's lambda >= 0 in |Y - K X|^2 + lambda |K|^2 (Frobenius norms).
        rank: at most so many singular values of X are used; None uses all.
        tolerance: singular values below this part of the largest are dropped; None takes rounding, max(shape) * eps.
    """

    ridge: float = 0.0
    rank: int | None = None
    tolerance: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.ridge < float("inf"):
            raise KoopmanError(f"the ridge must be zero or positive and finite, not {self.ridge}")
        if self.rank is not None and self.rank < 1:
            raise KoopmanError(f"the rank must be at least 1, not {self.rank}")
        if self.tolerance is not None and not 0.0 <= self.tolerance < 1.0:
            raise KoopmanError(f"the tolerance must be in [0, 1), not {self.tolerance}")


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solution K (q, n) of K X = Y, the condition number of X (n, m) and the rank that was used."""

    k: Matrix
    condition_number: float
    rank: int


def solve(x: Matrix, y: Matrix, how: Regularization) -> LeastSquares:
    """Minimise |Y - K X|^2 + ridge |K|^2 over K; the solution of least norm where there are many.

    With X = U S V', K = Y V f(S) U', f(s) = s / (s^2 + ridge) for the singular values that are kept and 0 for others.
    X X' is never formed: its condition number is the square of X's.

    Args:
        x: X, shape (n, m), finite.
        y: Y, shape (q, m), finite.
        how: ridge and truncation.

    Raises:
        KoopmanError: if the solution overflows.
    """
    u, s, vt = singular_values(x)
    largest = s[0] if s.size else 0.0
    tolerance = how.tolerance if how.tolerance is not None else max(x.shape) * np.finfo(float).eps
    keep = (s > 0.0) & (s >= tolerance * largest)
    if how.rank is not None:
        keep[how.rank :] = False
    with np.errstate(over="ignore", invalid="ignore"):
        weights = 1.0 / (s[keep] + how.ridge / s[keep])
        k = ((y @ vt[keep].T) * weights) @ u[:, keep].T
        condition = largest / s[-1] if len(s) == x.shape[0] and s[-1] > 0.0 else float("inf")
    check_finite(k, "the least-squares fit")
    return LeastSquares(k, float(condition), int(keep.sum()))


def as_lists(array: Matrix) -> list[Any]:
    """Return an array as nested lists of floats, which JSON holds to the last bit."""
    lists: list[Any] = array.tolist()
    return lists
