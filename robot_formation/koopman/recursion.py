"""What online and windowed DMD have in common: settings, prior, checked pairs, state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.linear_algebra import (
    KoopmanError,
    Matrix,
    Vector,
    as_lists,
    as_matrix,
    as_vector,
    singular_values,
)

# Rounding grows with the square of X's condition number in a recursion of P: up to this one it stays below 1e-9.
RECURSION_CONDITION = 1e3
# Above this condition number of X the inverse of X X' has no correct digit left.
_LARGEST_CONDITION = 1e7
# Sizes of x and y, and singular values of X, whose squares are far from overflow and underflow.
_LARGEST = 1e100
_FINEST, _COARSEST = 1e-50, 1e50
# Trace of P, that is, of singular values of X above the finest.
LARGEST_P = 1e98
# K x stays finite.
_LARGEST_K = 1e150


class RecursiveFit:
    """K fitted to pairs (x, y) with a forgetting factor and a prior; `k` has shape (outputs, dimension)."""

    def __init__(
        self,
        dimension: int,
        outputs: int | None,
        forgetting: float,
        prior_weight: ArrayLike,
        prior_k: ArrayLike | None,
        max_condition: float,
    ) -> None:
        if dimension < 1 or not 0.0 < forgetting <= 1.0 or (outputs is not None and outputs < 1):
            raise KoopmanError(
                "online DMD needs a dimension of at least 1 and a forgetting factor in (0, 1], "
                f"not dimension {dimension}, outputs {outputs} and forgetting factor {forgetting}"
            )
        if not 1.0 < max_condition <= _LARGEST_CONDITION:
            raise KoopmanError(
                f"the largest condition number must be above 1 and at most {_LARGEST_CONDITION:g}, not {max_condition}"
            )
        self.dimension = dimension
        self.outputs = dimension if outputs is None else outputs
        self.forgetting = forgetting
        self.max_condition = max_condition
        self._weights = self._prior_weights(prior_weight)
        if prior_k is not None and not self._weights.any():
            raise KoopmanError("a prior K needs a prior weight above zero")
        prior = np.eye(self.outputs, dimension) if prior_k is None else as_matrix(prior_k, "the prior K", self.outputs)
        self._prior_k = as_matrix(prior, "the prior K", self.outputs, dimension).copy()
        # Fits are made of differences to this K, so that what the data don't show stays as in the prior.
        self._k0 = self._prior_k if self._weights.any() else np.zeros_like(self._prior_k)
        self.k: Matrix = self._prior_k.copy()

    def _prior_weights(self, weight: ArrayLike) -> Vector:
        if np.ndim(weight) == 0:
            weight = np.full(self.dimension, weight)
        weights = as_vector(weight, "the prior weight", self.dimension)
        if weights.any() and not ((weights >= _FINEST) & (weights <= _COARSEST)).all():
            raise KoopmanError(f"prior weights must all be zero, or all between {_FINEST:g} and {_COARSEST:g}")
        return weights

    def __repr__(self) -> str:
        shown = [f"{self.dimension}", *self._arguments()]
        if self.outputs != self.dimension:
            shown.append(f"outputs={self.outputs}")
        if self.forgetting != 1.0:
            shown.append(f"forgetting={self.forgetting:g}")
        if self._weights.any():
            same = bool((self._weights == self._weights[0]).all())
            shown.append(f"prior_weight={self._weights[0]:g}" if same else f"prior_weight=<{self.dimension} numbers>")
        return f"{type(self).__name__}({', '.join(shown)})"

    def _arguments(self) -> list[str]:
        """Write what else a subclass needs to be made, after the dimension."""
        return []

    def prior_rows(self) -> Matrix:
        """Return the prior as rows of X': (n, n), or (0, n) without a prior."""
        rows = np.diag(np.sqrt(self._weights))
        return np.asarray(rows if self._weights.any() else rows[:0])

    def pair(self, x: ArrayLike, y: ArrayLike) -> tuple[Vector, Vector]:
        """Check a pair.

        Raises:
            KoopmanError: on a wrong shape, or a value that is not finite or too large.
        """
        n, q = self.dimension, self.outputs
        try:
            before, after = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        except (TypeError, ValueError) as error:
            raise KoopmanError(f"a pair must be two vectors of real numbers: {error}") from error
        fits = before.shape == (n,) and after.shape == (q,)
        # Sums of Python's floats become infinite or NaN without a warning, and comparisons with NaN are false.
        if fits and sum(map(abs, before.tolist())) <= _LARGEST and sum(map(abs, after.tolist())) <= _LARGEST:
            return before, after
        lengths = f"two finite vectors of length {n}" if n == q else f"two finite vectors of lengths {n} and {q}"
        text = f"a pair must be {lengths} whose magnitudes add up to at most {_LARGEST:g}"
        if fits:
            raise KoopmanError(text)
        several = "; of many pairs, update with one after the other" if 2 in (before.ndim, after.ndim) else ""
        raise KoopmanError(f"{text}, not arrays of shapes {before.shape} and {after.shape}{several}")

    def solve(self, rows: Matrix, targets: Matrix) -> tuple[Matrix, Vector, Matrix]:
        """Solve rows (K - K0)' = targets for the K of least |K - K0|.

        Args:
            rows: weighted xs as rows (m, n).
            targets: weighted y - K0 x as rows (m, outputs).

        Returns:
            K, the singular values of the rows and their right singular vectors as rows.

        Raises:
            KoopmanError: if K overflows.
        """
        u, s, vt = singular_values(rows)
        keep = s > s[0] / self.max_condition if s.size else np.zeros(0, dtype=bool)
        with np.errstate(over="ignore", invalid="ignore"):
            k = self._k0 + ((u[:, keep].T @ targets) / s[keep, None]).T @ vt[keep]
        if not abs(k).max() <= _LARGEST_K:
            raise KoopmanError("K would overflow: y is too large for so small an x")
        return k, s, vt

    def rank(self, s: Vector, condition: float) -> int:
        """Count the directions in which X, with singular values s, is not smaller by more than the condition number."""
        return int((s > max(s[0] / condition, _FINEST)).sum()) if s.size else 0

    def recursive(self, s: Vector, condition: float) -> bool:
        """Whether X is conditioned well enough for a recursion of P."""
        bound = max(s[0] / min(condition, self.max_condition), _FINEST) if s.size else 0.0
        return len(s) == self.dimension and bool(s[-1] >= bound and s[0] <= _COARSEST)

    def settings(self) -> JsonObject:
        """Return the arguments of the constructor."""
        return {
            "dimension": self.dimension,
            "outputs": self.outputs,
            "forgetting": self.forgetting,
            "prior_weight": as_lists(self._weights),
            "prior_k": as_lists(self._prior_k) if self._weights.any() else None,
            "max_condition": self.max_condition,
        }


def inverse_gram(s: Vector, vt: Matrix) -> Matrix:
    """Return P = (X X')^-1, exactly symmetric, from the singular values and right singular vectors of X'."""
    p = (vt.T / s**2) @ vt
    return np.asarray((p + p.T) / 2.0)


@contextmanager
def reading_state() -> Iterator[None]:
    """Turn what goes wrong while a stored state is read into one sentence.

    Raises:
        KoopmanError: instead of the errors of Python.
    """
    try:
        yield
    except KoopmanError:
        raise
    except KeyError as error:
        raise KoopmanError(f"the stored state has no {error}") from error
    except (IndexError, OverflowError, TypeError, ValueError) as error:
        raise KoopmanError(f"the stored state is none of this kind of model: {error}") from error


def restored(state: Mapping[str, Json], name: str, rows: int | None, columns: int) -> Matrix:
    """Read a matrix from a stored state; one without rows has the given number of columns.

    Raises:
        KoopmanError: if it has another shape, or is not finite.
    """
    stored = state[name] if len(state[name]) else np.zeros((0, columns))
    return np.array(as_matrix(stored, f"'{name}' of the stored state", rows, columns))


def restored_p(state: Mapping[str, Json], dimension: int) -> Matrix | None:
    """Read P from a stored state.

    Raises:
        KoopmanError: if it is not symmetric and positive definite.
    """
    if state["p"] is None:
        return None
    p = restored(state, "p", dimension, dimension)
    if not (p == p.T).all() or np.linalg.eigvalsh(p)[0] <= 0.0:
        raise KoopmanError("'p' of the stored state must be symmetric and positive definite")
    return p
