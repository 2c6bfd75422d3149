"""Checked input, and least squares that survive any finite data: what the parts of this package share."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real
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
    """Return a finite matrix of floats, one column per snapshot, of the given shape where one is given.

    Raises:
        KoopmanError: if it is none; the text says so where rows and columns are swapped.
    """
    matrix = _floats(value, what)
    if matrix.ndim != 2 or (rows is not None and matrix.shape[0] != rows):
        wanted = "" if rows is None else f" with {rows} row{'s' * (rows != 1)}"
        text = f"{what} must be a matrix{wanted}, one column per snapshot, not of shape {matrix.shape}"
        raise KoopmanError(text + _remedy(matrix, rows))
    if columns is not None and matrix.shape[1] != columns:
        text = f"{what} must have {columns} column{'s' * (columns != 1)}, not {matrix.shape[1]}"
        swapped = rows is None and matrix.shape[0] == columns
        raise KoopmanError(text + ("; it has as many rows: transpose it" if swapped else ""))
    return matrix


def _remedy(matrix: Matrix, rows: int | None) -> str:
    """Say what to do with an array that holds snapshots of the right length in the wrong places."""
    if rows is not None and matrix.ndim == 2 and matrix.shape[1] == rows:
        count = matrix.shape[0]
        return f"; it has {count} row{'s' * (count != 1)} of {rows} values, so its snapshots are rows: transpose it"
    if rows is not None and matrix.shape == (rows,):
        return "; one snapshot is a column by itself: reshape(-1, 1)"
    return "; snapshots of one value are a single row: reshape(1, -1)" if rows == 1 and matrix.ndim == 1 else ""


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
        if np.iscomplexobj(value):
            raise KoopmanError(f"{what} must hold real numbers only, not complex ones")
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


def check_time_step(dt: float) -> None:
    """Refuse what is no time between samples.

    Raises:
        KoopmanError: if dt is no number, or not positive and finite.
    """
    if not (isinstance(dt, Real) and 0.0 < dt < float("inf")):
        raise KoopmanError(f"the time between samples must be a number, positive and finite, not {dt!r}")


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
        ridge, rank, tolerance = self.ridge, self.rank, self.tolerance
        if not (isinstance(ridge, Real) and 0.0 <= ridge < float("inf")):
            raise KoopmanError(f"the ridge must be a number, zero or positive and finite, not {ridge!r}")
        if rank is not None and not (isinstance(rank, Integral) and rank >= 1):
            raise KoopmanError(f"the rank must be a whole number of at least 1, or None, not {rank!r}")
        if tolerance is not None and not (isinstance(tolerance, Real) and 0.0 <= tolerance < 1.0):
            raise KoopmanError(f"the tolerance must be a number in [0, 1), or None, not {tolerance!r}")


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
