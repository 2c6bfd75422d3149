"""Radial basis functions: observables of the distance to centres."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.koopman.dictionaries import Observables
from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, as_matrix
from robot_formation.parameters import suggestion


def _thin_plate(r: Matrix) -> Matrix:
    return r**2 * np.log(np.where(r > 0.0, r, 1.0))


# Functions of r = |x - c| / width.
KINDS: MappingProxyType[str, Callable[[Matrix], Matrix]] = MappingProxyType(
    {
        "gaussian": lambda r: np.exp(-(r**2)),
        "thin_plate": _thin_plate,
        "inverse_quadratic": lambda r: 1.0 / (1.0 + r**2),
    }
)


class RadialBasis(Observables):
    """One observable per centre c, of r = |x - c| / width.

    Kinds: gaussian exp(-r^2), thin_plate r^2 log r (0 at the centre), inverse_quadratic 1 / (1 + r^2).
    """

    def __init__(self, centres: ArrayLike, kind: str = "gaussian", *, width: float = 1.0) -> None:
        """Set centres (n, k), one per column, and a width in the units of the state.

        Raises:
            KoopmanError: on centres that are not finite, an unknown kind or a width that is not positive.
        """
        columns = as_matrix(centres, "the centres")
        if 0 in columns.shape:
            raise KoopmanError("there must be at least one centre")
        if kind not in KINDS:
            raise KoopmanError(f"there is no radial basis function '{kind}'{suggestion(kind, KINDS)}")
        if not 0.0 < width < float("inf"):
            raise KoopmanError(f"the width of a radial basis function must be positive and finite, not {width}")
        super().__init__(columns.shape[0], [f"{kind}(x - c{i + 1})" for i in range(columns.shape[1])])
        self.centres = columns.copy()
        self.width = width
        self._kind = kind

    def __repr__(self) -> str:
        n, k = self.centres.shape
        return f"RadialBasis(<{k} centres of length {n}>, '{self._kind}', width={self.width:.6g})"

    @classmethod
    def from_data(
        cls,
        X: ArrayLike,
        count: int,
        rng: np.random.Generator,
        kind: str = "gaussian",
        *,
        width: float | None = None,
    ) -> RadialBasis:
        """Choose centres among the snapshots (n, m), one per column, spread out, and if none is given a width.

        The first is drawn uniformly, each next one with a probability proportional to the squared distance to the
        nearest centre so far (the start of k-means++, Arthur and Vassilvitskii 2007). The width is then the median
        distance between two centres.

        Raises:
            KoopmanError: if there are fewer different snapshots than centres.
        """
        points = as_matrix(X, "the snapshots")
        if count < 1 or 0 in points.shape:
            raise KoopmanError("there must be at least one centre and one snapshot to choose from")
        chosen = [int(rng.integers(points.shape[1]))]
        nearest = _distances(points, points[:, chosen])[0]
        while len(chosen) < count:
            if not nearest.any():
                raise KoopmanError(f"{count} centres were asked for, but only {len(chosen)} snapshots are different")
            weights = (nearest / nearest.max()) ** 2
            chosen.append(int(rng.choice(points.shape[1], p=weights / weights.sum())))
            nearest = np.minimum(nearest, _distances(points, points[:, chosen[-1:]])[0])
        centres = points[:, chosen]
        if width is None:
            between = _distances(centres, centres)[np.triu_indices(count, 1)]
            width = float(np.median(between)) if count > 1 else 1.0
        return cls(centres, kind, width=width)

    def _lift(self, X: Matrix) -> Matrix:
        return KINDS[self._kind](_distances(X, self.centres) / self.width)


def _distances(X: Matrix, centres: Matrix) -> Matrix:
    """Return the distances (k, m) of states (n, m) to centres (n, k)."""
    distances: Matrix = np.linalg.norm(X[:, None, :] - centres[:, :, None], axis=0)
    return distances
