"""Online dynamic mode decomposition: a linear map learned pair by pair, by recursive least squares.

Convention of the paper: K X = Y, columns are snapshots; x and y may be states, or observables Psi(x) and Psi(y) of any
dictionary (online EDMD). Algorithm 1 of the paper starts from P = (X X')^-1 and K = Y X^+ and updates both with each
pair (x, y),

    K <- K + (y - K x) x' P / (1 + x' P x),     P <- P - P x x' P / (1 + x' P x),

the recursion of Zhang, Rowley, Deem and Cattafesta, "Online dynamic mode decomposition for time-varying systems", SIAM
J. Appl. Dyn. Syst. 18(3), 2019 (arXiv 1707.02876). It keeps K equal to the least-squares solution Y X^+ of all pairs so
far, provided that y is *measured*; the predictor `literal` is what the paper prints. With a forgetting factor rho,

    K <- K + (y - K x) x' P / (rho + x' P x),     P <- (P - P x x' P / (rho + x' P x)) / rho,

it is the solution where a pair's squared error weighs rho times as much as that of the next newer one. An update takes
4 n^2 multiplications.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, Vector, as_lists
from robot_formation.koopman.recursion import (
    LARGEST_P,
    RECURSION_CONDITION,
    RecursiveFit,
    inverse_gram,
    reading_state,
    restored,
    restored_p,
)


class _Fit(NamedTuple):
    """Factors R and Z, the K they give, and singular values and right singular vectors of R."""

    r: Matrix
    z: Matrix
    k: Matrix
    s: Vector
    vt: Matrix


class OnlineDMD(RecursiveFit):
    """K of shape (outputs, n) fitted to all pairs (x, y) so far, x of length n = `dimension`.

    With rho the forgetting factor, N the number of pairs and lambda the prior's weights, K minimises

        sum_t rho^(N - t) |y_t - K x_t|^2 + rho^N sum_i lambda_i |column i of K - K0|^2:

    the prior is what was known before the first pair, and is forgotten like a pair. Without a prior, as long as X has
    no full rank, K is the solution of least norm (pseudo-inverse, as in Algorithm 1).

    The recursion of P loses digits with the square of X's condition number. While that is above 1000, K comes from a
    triangular factor of X instead, updated by an orthogonal transformation in O(n^3) operations, which loses no more
    than the data themselves.

    P is bounded: where the data leave a direction unexcited for so long that it would drop out of the
    sqrt(`max_condition`) largest-to-smallest range of X, only what is known along x is forgotten, so that the direction
    keeps what it has learned.
    """

    def __init__(
        self,
        dimension: int,
        *,
        outputs: int | None = None,
        forgetting: float = 1.0,
        prior_weight: ArrayLike = 0.0,
        prior_k: ArrayLike | None = None,
        max_condition: float = 1e7,
    ) -> None:
        """Start with no data.

        Args:
            dimension: length n of x.
            outputs: length of y if it is not that of x (as with inputs, y = [K B] [x; u]).
            forgetting: rho in (0, 1]; 1 forgets nothing.
            prior_weight: lambda, one number or one for each component of x, in its unit squared: P starts as
                diag(1 / lambda). 0: no prior.
            prior_k: K0, shape (outputs, n); the identity (nothing changes) if not given.
            max_condition: directions in which X is smaller than in its largest by more than this factor count as not
                seen, above 1 and at most 1e7.

        Raises:
            KoopmanError: if an argument makes no sense.
        """
        super().__init__(dimension, outputs, forgetting, prior_weight, prior_k, max_condition)
        # Known is either P, or a factor R of (X X') = R' R with Z = Q' (Y - K0 X)', where X' = Q R.
        self._p: Matrix | None = None
        self._trace = 0.0  # of X X', so that trace(P) trace(X X') bounds P's condition number at little cost
        self._r = self.prior_rows()
        self._z = np.zeros((len(self._r), self.outputs))
        self._kept = (0, 0)
        if len(self._r):
            self._take(_Fit(self._r, self._z, *self.solve(self._r, self._z)))

    @property
    def fitted(self) -> bool:
        """Whether K comes from a pair or a prior."""
        return self._p is not None or len(self._r) > 0

    @property
    def started(self) -> bool:
        """Whether the data, with the prior, have full rank."""
        return self._p is not None or self._kept[1] == self.dimension

    @property
    def p(self) -> Matrix | None:
        """P = (X X')^-1 of the weighted pairs and the prior, shape (n, n); None before they have full rank."""
        if self._p is not None:
            return np.array(self._p)
        if not self.started:
            return None
        inverse = np.linalg.pinv(self._r)
        return np.asarray(inverse @ inverse.T)

    @property
    def condition_number(self) -> float:
        """Condition number of the weighted X with the prior; infinite before they have full rank."""
        if not self.started:
            return float("inf")
        return float(np.linalg.cond(self._r) if self._p is None else np.sqrt(np.linalg.cond(self._p)))

    def update(self, x: ArrayLike, y: ArrayLike) -> Vector:
        """Update with one measured pair; return the innovation y - K x of the K before the update, shape (outputs,).

        Args:
            x: shape (n,). Of matrices of snapshots, one column or row after the other.
            y: shape (outputs,).

        Raises:
            KoopmanError: on a wrong shape, or a value that is not finite or beyond 1e100; nothing is learned then.
        """
        return self.learn(*self.pair(x, y))

    def learn(self, x: Vector, y: Vector) -> Vector:
        """Do what `update` does with vectors that are known to be finite and of the right shape: nothing is checked."""
        innovation: Vector = y - self.k.dot(x)
        if self._p is None or not self._recursion(self._p, x, innovation):
            self._factor(x, y)
        return innovation

    def _recursion(self, p: Matrix, x: Vector, innovation: Vector) -> bool:
        """Update K and P; if X would be conditioned too badly for that, go back to the factor and return False."""
        rho = self.forgetting
        px = p.dot(x)
        scale = rho + float(x.dot(px))
        column = px[:, None]  # products of a column and a row are faster than broadcasting
        new = p - column.dot(column.T) / scale  # symmetric to the last bit, if P is
        if rho != 1.0:
            new /= rho
        trace = rho * self._trace + float(x.dot(x))
        size: float = sum(new.diagonal().tolist())
        if not (size * trace <= RECURSION_CONDITION**2 and size <= LARGEST_P):
            eigenvalues, vectors = np.linalg.eigh(p)
            self._r = (vectors / np.sqrt(eigenvalues)).T
            self._z = self._r @ (self.k - self._k0).T
            self._kept, self._p = (self.dimension, self.dimension), None
            return False
        self.k = self.k + innovation[:, None].dot(column.T / scale)
        self._p, self._trace = new, trace
        return True

    def _factor(self, x: Vector, y: Vector) -> None:
        """Update the factor, and K from it; forget along x only if that saves a direction from being lost."""
        known = np.hstack([self._r, self._z])
        new = np.concatenate([x, y - self._k0 @ x])
        fit = self._fit(known * np.sqrt(self.forgetting), new)
        if self.forgetting < 1.0 and self._ranks(fit.s) < self._kept:
            other = self._fit(self._forget_along(known, x), new)
            fit = max(fit, other, key=lambda either: self._ranks(either.s))
        self._take(fit)

    def _fit(self, known: Matrix, new: Vector) -> _Fit:
        n = self.dimension
        factor = np.asarray(np.linalg.qr(np.vstack([known, new]), mode="r"))[:n]
        return _Fit(factor[:, :n], factor[:, n:], *self.solve(factor[:, :n], factor[:, n:]))

    def _forget_along(self, known: Matrix, x: Vector) -> Matrix:
        """Discount what is known of K x only (directional forgetting, Kulhavy, Automatica 23(5), 1987)."""
        direction = known[:, : self.dimension] @ x
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            return known
        direction = direction / length
        return np.asarray(known - (1.0 - np.sqrt(self.forgetting)) * np.outer(direction, direction @ known))

    def _ranks(self, s: Vector) -> tuple[int, int]:
        """Count the directions that the data show well, and those that they show at all."""
        return self.rank(s, np.sqrt(self.max_condition)), self.rank(s, self.max_condition)

    def _take(self, fit: _Fit) -> None:
        self.k, self._r, self._z, self._kept = fit.k, fit.r, fit.z, self._ranks(fit.s)
        # A third of the bound, so that the two forms don't take turns.
        if self.recursive(fit.s, RECURSION_CONDITION / 3.0):
            self._p = inverse_gram(fit.s, fit.vt)
            self._trace = float((fit.s**2).sum())
            self._r, self._z = self._r[:0], self._z[:0]

    def state(self) -> JsonObject:
        """Return all there is to know as numbers, lists and None, for `from_state` and JSON."""
        return {
            "settings": self.settings(),
            "k": as_lists(self.k),
            "p": None if self._p is None else as_lists(self._p),
            "trace": self._trace,
            "r": as_lists(self._r),
            "z": as_lists(self._z),
            "kept": list(self._kept),
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Json]) -> OnlineDMD:
        """Make one that goes on, to the last bit, where another one's `state` was taken.

        Raises:
            KoopmanError: if it is no such state.
        """
        with reading_state():
            dmd = cls(**state["settings"])
            n, q = dmd.dimension, dmd.outputs
            dmd.k, dmd._p = restored(state, "k", q, n), restored_p(state, n)
            dmd._r, dmd._z = restored(state, "r", None, n), restored(state, "z", None, q)
            dmd._kept = (int(state["kept"][0]), int(state["kept"][1]))
            dmd._trace = float(state["trace"])
        if (
            len(dmd._r) != len(dmd._z)
            or not all(0 <= rank <= n for rank in dmd._kept)
            or not 0.0 <= dmd._trace < float("inf")
        ):
            raise KoopmanError("'r', 'z', 'kept' and 'trace' of the stored state don't fit each other")
        return dmd
