"""Online dynamic mode decomposition: a linear map learned pair by pair, by recursive least squares.

Convention of the paper: K X = Y, columns are snapshots. Recursion of Zhang, Rowley, Deem and Cattafesta, "Online
dynamic mode decomposition for time-varying systems", SIAM J. Appl. Dyn. Syst. 18(3), 2019 (arXiv 1707.02876), with
*measured* pairs (x, y):

    gamma = 1 / (rho + x' P x),   K <- K + gamma (y - K x) x' P,   P <- (P - gamma P x x' P) / rho

which keeps K equal to the (weighted) batch least-squares solution Y X^+ of all pairs so far.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

# Above this condition number of X the inverse of X X' has no correct digit left, so the start is postponed.
_MAX_CONDITION = 1e7
# Far beyond any P that data can give, far below overflow.
_MAX_P = 1e100


class OnlineDMD:
    """K of shape (n, n) fitted to pairs (x, y) of shape (n,); forgetting factor rho in (0, 1].

    Until X has full rank K is the minimum-norm batch solution (pseudo-inverse, as in Algorithm 1 of the paper); then
    each update costs O(n^2). With forgetting a guard against windup, O(n^3), comes on top: while the data leave a
    direction unexcited for so long that P would lose its last correct digit, nothing is forgotten.
    """

    def __init__(self, dimension: int, *, forgetting: float = 1.0) -> None:
        if dimension < 1 or not 0.0 < forgetting <= 1.0:
            raise ValueError("OnlineDMD needs a dimension of at least 1 and a forgetting factor in (0, 1]")
        self._forgetting = forgetting
        self._pairs: list[tuple[Vector, Vector]] = []
        self._p: Matrix | None = None
        self.k: Matrix = np.eye(dimension)

    @property
    def started(self) -> bool:
        """Whether the recursion runs, that is, the data have full rank."""
        return self._p is not None

    @property
    def condition_number(self) -> float:
        """Condition number of X (square root of that of P), infinite before the data have full rank."""
        if self._p is None:
            return float("inf")
        return float(np.sqrt(np.linalg.cond(self._p)))

    def update(self, x: Vector, y: Vector) -> Vector:
        """Take one measured pair; return the innovation y - K x of the K before the update, shape (n,).

        Raises:
            ValueError: on a wrong shape or a non-finite value; nothing is learned then.
        """
        n = self.k.shape[0]
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if x.shape != (n,) or y.shape != (n,) or not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise ValueError(f"a pair must be two finite vectors of length {n}")
        innovation = y - self.k @ x
        if self._p is None:
            self._start(x, y)
            return innovation
        rho = self._forgetting if self._may_forget() else 1.0
        px = self._p @ x
        gamma = 1.0 / (rho + float(x @ px))
        self.k = self.k + gamma * np.outer(innovation, px)
        p = (self._p - gamma * np.outer(px, px)) / rho
        self._p = (p + p.T) / 2.0  # rounding must not make P asymmetric
        return innovation

    def _may_forget(self) -> bool:
        if self._forgetting == 1.0 or self._p is None:
            return False
        eigenvalues = np.linalg.eigvalsh(self._p)
        return bool(eigenvalues[-1] <= min(eigenvalues[0] * _MAX_CONDITION**2, _MAX_P))

    def _start(self, x: Vector, y: Vector) -> None:
        self._pairs.append((x, y))
        weights = np.sqrt(self._forgetting) ** np.arange(len(self._pairs) - 1, -1, -1)
        xs = np.column_stack([pair[0] for pair in self._pairs]) * weights
        ys = np.column_stack([pair[1] for pair in self._pairs]) * weights
        self.k = ys @ np.linalg.pinv(xs, rcond=1.0 / _MAX_CONDITION)
        singular = np.linalg.svd(xs, compute_uv=False)
        smallest = max(singular[0] / _MAX_CONDITION, _MAX_P**-0.5)
        if len(singular) == self.k.shape[0] and singular[-1] > smallest:
            self._p = np.linalg.inv(xs @ xs.T)
            self._pairs.clear()
