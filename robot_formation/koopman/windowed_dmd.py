"""Windowed online DMD: a linear map fitted to the latest w pairs only.

Zhang, Rowley, Deem and Cattafesta, "Online dynamic mode decomposition for time-varying systems", SIAM J. Appl. Dyn.
Syst. 18(3), 2019 (arXiv 1707.02876), section on windowed dynamic mode decomposition. When the pair (x, y) comes and the
oldest, (x_o, y_o), goes, with U = [x_o x], V = [y_o y] and C = diag(-1, 1),

    G = (C^-1 + U' P U)^-1,     K <- K + (V - K U) G U' P,     P <- P - P U G U' P:

8 n^2 multiplications. With a forgetting factor rho, first P <- P / rho, and C = diag(-rho^w, 1).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, Vector, as_lists, as_vector
from robot_formation.koopman.recursion import (
    LARGEST_P,
    RecursiveFit,
    inverse_gram,
    reading_state,
    restored,
    restored_p,
)

# Condition number of X up to which P is carried on. What rounds off while P is large stays when P gets small: errors
# grow with the fourth power; up to this one they stay below 1e-9.
_DOWNDATE_CONDITION = 30.0


class WindowedDMD(RecursiveFit):
    """K of shape (outputs, n) fitted to the latest `window` pairs (x, y), x of length n = `dimension`.

    With rho the forgetting factor, N the number of updates, w the window and lambda the prior's weights, K minimises

        sum over the latest w pairs of rho^age |y - K x|^2 + rho^N sum_i lambda_i |column i of K - K0|^2:

    the prior never leaves the window, but is forgotten as a pair would be. As long as the window and the prior have no
    full rank, K is the solution of least norm.

    Taking pairs out of P magnifies its rounding errors, so the fit is made anew from the window's pairs, in O(w n^2)
    operations, every w updates and whenever X's condition number is above 30.
    """

    def __init__(
        self,
        dimension: int,
        window: int,
        *,
        outputs: int | None = None,
        forgetting: float = 1.0,
        prior_weight: ArrayLike = 0.0,
        prior_k: ArrayLike | None = None,
        max_condition: float = 1e7,
    ) -> None:
        """Start with an empty window of `window` pairs, at least one; for the other arguments see `OnlineDMD`.

        Raises:
            KoopmanError: if an argument makes no sense.
        """
        super().__init__(dimension, outputs, forgetting, prior_weight, prior_k, max_condition)
        if window < 1:
            raise KoopmanError(f"the window must hold at least one pair, not {window}")
        self.window = window
        self._pairs: deque[tuple[Vector, Vector]] = deque()
        self._p: Matrix | None = None
        self._trace = 0.0  # of X X', so that trace(P) trace(X X') bounds P's condition number at little cost
        self._since_refit = 0
        self._prior_share = 1.0  # rho^N
        self._singular = np.zeros(0)
        if self._weights.any():
            self._refit()

    @property
    def started(self) -> bool:
        """Whether the window, with the prior, has full rank."""
        return self._p is not None or self.rank(self._singular, self.max_condition) == self.dimension

    @property
    def p(self) -> Matrix | None:
        """P = (X X')^-1 of the weighted window and the prior, shape (n, n); None if they don't have full rank."""
        if self._p is not None:
            return np.array(self._p)
        return inverse_gram(*self._solve_window()[1:]) if self.started else None

    @property
    def condition_number(self) -> float:
        """Condition number of the weighted window with the prior; infinite if they don't have full rank."""
        if not self.started:
            return float("inf")
        if self._p is None:
            return float(self._singular[0] / self._singular[-1])
        return float(np.sqrt(np.linalg.cond(self._p)))

    def update(self, x: ArrayLike, y: ArrayLike) -> Vector:
        """Take one measured pair and drop the oldest of a full window.

        Returns:
            The innovation y - K x of the K before the update, shape (outputs,).

        Raises:
            KoopmanError: on a wrong shape, or a value that is not finite or beyond 1e100; nothing is learned then.
        """
        pair = self.pair(x, y)
        innovation: Vector = pair[1] - self.k.dot(pair[0])
        saved = self._pairs.copy(), self._prior_share
        dropped = self._pairs.popleft() if len(self._pairs) == self.window else None
        self._pairs.append((pair[0].copy(), pair[1].copy()))
        self._prior_share *= self.forgetting
        self._since_refit += 1
        if self._p is None or self._since_refit >= self.window or not self._recursion(self._p, *pair, dropped):
            try:
                self._refit()
            except KoopmanError:
                self._pairs, self._prior_share = saved
                raise
        return innovation

    def _recursion(self, p: Matrix, x: Vector, y: Vector, dropped: tuple[Vector, Vector] | None) -> bool:
        """Update K and P; leave them and return False if X is conditioned too badly for that."""
        rho, share = self.forgetting, self.forgetting**self.window
        old_x, old_y = (np.zeros_like(x), np.zeros_like(y)) if dropped is None else dropped
        u, v = np.array([old_x, x]), np.array([old_y, y])  # rows here, so that they are U' and V'
        up = u.dot(p) / rho
        m = up.dot(u.T)
        # G = C (1 + U' P U C)^-1 with C = diag(-share, 1): symmetric, and defined if the oldest pair's share is 0 too.
        a, b, d = 1.0 - share * float(m[0, 0]), float(m[0, 1]), 1.0 + float(m[1, 1])
        determinant = a * d + share * b**2
        if not determinant > _DOWNDATE_CONDITION**-2:
            return False
        g = np.array([[-share * d, share * b], [share * b, a]]) / determinant
        gain = g.dot(up)
        new = p / rho - up.T.dot(gain)
        trace = rho * self._trace + float(x.dot(x)) - share * float(old_x.dot(old_x))
        size = float(new.trace())
        if not (0.0 < size * trace <= _DOWNDATE_CONDITION**2 and size <= LARGEST_P):
            return False
        self.k = self.k + (v - u.dot(self.k.T)).T.dot(gain)
        self._p = (new + new.T) / 2.0  # rounding must not make P asymmetric
        self._trace = trace
        return True

    def _solve_window(self) -> tuple[Matrix, Vector, Matrix]:
        weights = np.sqrt(self.forgetting) ** np.arange(len(self._pairs) - 1, -1, -1)
        xs = np.array([x for x, _ in self._pairs]).reshape(-1, self.dimension)
        ys = np.array([y for _, y in self._pairs]).reshape(-1, self.outputs)
        prior = self.prior_rows() * np.sqrt(self._prior_share)
        rows = np.vstack([prior, xs * weights[:, None]])
        targets = np.vstack([np.zeros((len(prior), self.outputs)), (ys - xs @ self._k0.T) * weights[:, None]])
        return self.solve(rows, targets)

    def _refit(self) -> None:
        """Fit to the window's pairs and the prior anew."""
        self.k, s, vt = self._solve_window()
        self._singular = s
        self._since_refit = 0
        self._p = None
        if self.recursive(s, _DOWNDATE_CONDITION / 3.0):
            self._p = inverse_gram(s, vt)
            self._trace = float((s**2).sum())

    def state(self) -> dict[str, Any]:
        """Return all there is to know as numbers, lists and None, for `from_state` and JSON."""
        return {
            "settings": {**self.settings(), "window": self.window},
            "k": as_lists(self.k),
            "p": None if self._p is None else as_lists(self._p),
            "trace": self._trace,
            "x": [as_lists(x) for x, _ in self._pairs],
            "y": [as_lists(y) for _, y in self._pairs],
            "since_refit": self._since_refit,
            "prior_share": self._prior_share,
            "singular": as_lists(self._singular),
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> WindowedDMD:
        """Make one that goes on, to the last bit, where another one's `state` was taken.

        Raises:
            KoopmanError: if it is no such state.
        """
        with reading_state():
            dmd = cls(**state["settings"])
            n, q = dmd.dimension, dmd.outputs
            dmd.k, dmd._p = restored(state, "k", q, n), restored_p(state, n)
            xs, ys = restored(state, "x", None, n), restored(state, "y", None, q)
            dmd._trace, dmd._prior_share = float(state["trace"]), float(state["prior_share"])
            dmd._since_refit = int(state["since_refit"])
            dmd._singular = as_vector(state["singular"], "'singular' of the stored state", len(state["singular"]))
        if (
            len(xs) != len(ys)
            or len(xs) > dmd.window
            or not 0.0 <= dmd._prior_share <= 1.0
            or not 0.0 <= dmd._trace < float("inf")
        ):
            raise KoopmanError("'x', 'y', 'prior_share' and 'trace' of the stored state don't fit each other")
        dmd._pairs.extend(islice(zip(xs, ys, strict=True), dmd.window))
        return dmd
