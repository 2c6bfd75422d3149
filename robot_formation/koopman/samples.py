"""Snapshots in rows, as scikit-learn has them: checks whose texts say what is swapped, and pairs of episodes.

A trajectory, or episode, is a matrix (m, n): m consecutive states of length n, one per row. Several episodes are a list
of such matrices, each of its own length, or one array (episodes, m, n).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.koopman.linear_algebra import KoopmanError, Matrix


def shift_episodes(episodes: Sequence[ArrayLike]) -> tuple[Matrix, Matrix, NDArray[np.int64]]:
    """Make pairs of episodes, for what takes rows in any order: cross-validation, shuffling, subsets.

    Args:
        episodes: matrices (m_i, n), one row per state, two rows or more each.

    Returns:
        X and y, shape (m, n), all states but the last of each episode and their successors; and for each pair the
        number of its episode from 0 on, shape (m,), which scikit-learn calls `groups`.

    Raises:
        KoopmanError: if an episode is too short or is no such matrix, or episodes have states of different lengths.
    """
    parts = checked_episodes(episodes)
    lengths = [len(part) - 1 for part in parts]
    if 0 in lengths:
        raise KoopmanError(f"episode {lengths.index(0) + 1} is too short: a pair needs two states")
    numbers = np.repeat(np.arange(len(parts), dtype=np.int64), lengths)
    return np.vstack([part[:-1] for part in parts]), np.vstack([part[1:] for part in parts]), numbers


def is_episodes(X: Any) -> bool:
    """Whether X holds several trajectories: a list or tuple of matrices, or an array of three dimensions."""
    if isinstance(X, (list, tuple)):
        return bool(X) and dimensions(X[0]) == 2
    return dimensions(X) == 3


def dimensions(value: Any) -> int:
    """Return how many dimensions an array, table or nested list has; -1 if its rows have different lengths."""
    try:
        return int(value.ndim) if hasattr(value, "ndim") else np.asarray(value).ndim
    except ValueError:
        return -1


def checked_episodes(episodes: Sequence[ArrayLike]) -> list[Matrix]:
    """Return the episodes as matrices with states of the same length.

    Raises:
        KoopmanError: if they are none.
    """
    if not is_episodes(episodes):
        raise KoopmanError("episodes must be a list of matrices, one row per state: put a single one into a list")
    parts = [checked_rows(episode, f"episode {i + 1}") for i, episode in enumerate(episodes)]
    for i, part in enumerate(parts):
        if part.shape[1] != parts[0].shape[1]:
            raise KoopmanError(
                f"episode {i + 1} has states of length {part.shape[1]}, episode 1 of length {parts[0].shape[1]}"
            )
    return parts


def checked_rows(value: Any, what: str) -> Matrix:
    """Return a finite matrix (m, n) of floats, one row per snapshot, both at least 1.

    The texts hold the phrases by which scikit-learn's checks and users know these errors.

    Raises:
        KoopmanError: if it is none.
        TypeError: if an element is no number.
    """
    matrix = _floats(value, what)
    if matrix.ndim != 2:
        raise KoopmanError(
            f"{what} must be a matrix, one row per snapshot, not of shape {matrix.shape}. Reshape your data: "
            "reshape(1, -1) makes one snapshot, reshape(-1, 1) snapshots of one value"
        )
    for count, kind in zip(matrix.shape, ("sample", "feature"), strict=True):
        if not count:
            raise KoopmanError(f"{what} has 0 {kind}(s) (shape={matrix.shape}) while a minimum of 1 is required.")
    return matrix


def checked_targets(value: Any, X: Matrix) -> Matrix:
    """Return y as finite floats (m,) or (m, q), as many as rows of X.

    Raises:
        KoopmanError: if it is none.
        TypeError: if an element is no number.
    """
    y = _floats(value, "y")
    if y.ndim not in (1, 2) or 0 in y.shape:
        raise KoopmanError(f"y must hold one row for each of the {len(X)} rows of X, not have shape {y.shape}")
    if len(y) != len(X):
        swapped = (
            f": snapshots are rows; transpose {'y' if len(X) > X.shape[1] else 'X'}?" if y.T.shape == X.shape else ""
        )
        raise KoopmanError(
            f"X and y must have as many rows, one per snapshot, but their shapes are {X.shape} and {y.shape}{swapped}"
        )
    return y


def check_features(X: Matrix, what: str, expected: int, who: str) -> None:
    """Refuse snapshots of another length.

    Raises:
        KoopmanError: if the rows of X don't have `expected` values; the text asks whether X is transposed if its
            columns have.
    """
    rows, columns = X.shape
    if columns == expected:
        return
    text = f"{what} has {columns} features, but {who} is expecting {expected} features as input: snapshots are rows"
    if rows == expected:
        raise KoopmanError(f"{text}, got {rows} row{'s' * (rows != 1)} of {columns} values: transpose?")
    raise KoopmanError(f"{text}, of {expected} value{'s' * (expected != 1)}; the shape is {X.shape}")


def feature_names(X: Any) -> NDArray[np.object_] | None:
    """Return the names of the columns of a table (data frame); None of what has none, or names that are no text."""
    columns = list(getattr(X, "columns", ()))
    named = bool(columns) and all(isinstance(name, str) for name in columns)
    return np.array(columns, dtype=object) if named else None


def check_feature_names(X: Any, expected: Sequence[str]) -> None:
    """Refuse a table whose columns are others than those of the fit, or in another order.

    Raises:
        KoopmanError: if they are.
    """
    found = feature_names(X)
    if found is None or list(found) == list(expected):
        return
    order = "in the same order " if sorted(found) == sorted(expected) else ""
    raise KoopmanError(
        f"The feature names should match those that were passed during fit: columns {list(expected)} are needed "
        f"{order}but they are {list(found)}"
    )


def _floats(value: Any, what: str) -> Matrix:
    if hasattr(value, "toarray"):
        raise KoopmanError(f"{what} is sparse, and only dense data are supported: use toarray()")
    if value is None:
        raise KoopmanError(f"{what} must hold real numbers, but it is None")
    try:
        array = np.asarray(value)
        if np.iscomplexobj(array):
            raise KoopmanError(f"Complex data not supported: {what} must hold real numbers")
        floats: Matrix = np.asarray(array, dtype=float)
    except ValueError as error:
        raise KoopmanError(f"{what} must hold real numbers only: {error}") from error
    if not np.isfinite(floats).all():
        raise KoopmanError(f"{what} must be finite, but it contains infinity (inf) or NaN")
    return floats
