"""The newest pairs that a model has learned from, so that diagnostics can judge its K by them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.linear_algebra import KoopmanError
from robot_formation.koopman.predictors.models import Matrix, Vector, packed, unpacked
from robot_formation.koopman.quality import EigenvalueQuality, consistency_index, eigenvalue_qualities

KEPT = 100


class PairLog:
    """Up to `KEPT` pairs of observables (k,), newest last."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._pairs: list[tuple[Vector, Vector]] = []

    def add(self, x: Vector, y: Vector) -> None:
        """Append a pair; the oldest one goes if there are too many."""
        self._pairs = [*self._pairs[-(KEPT - 1) :], (x, y)]

    def judge(self, k: Matrix, noise: Vector) -> tuple[float | None, list[EigenvalueQuality] | None]:
        """Return the consistency index and the quality of K's eigenvalues; None where the pairs are too few.

        Args:
            k: (k, k).
            noise: (k,) standard deviation of each observable's noise.
        """
        if len(self._pairs) <= self._size:
            return None, None
        x, y = (np.column_stack(part) for part in zip(*self._pairs, strict=True))
        try:
            return consistency_index(x, y), eigenvalue_qualities(k, x, y, noise)
        except (KoopmanError, np.linalg.LinAlgError):  # observables beyond what can be computed with
            return None, None

    def state(self) -> JsonObject:
        """Return the pairs."""
        return {"count": len(self._pairs), "pairs": packed(np.array(self._pairs))}

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        count = int(state["count"])
        if not 0 <= count <= KEPT:
            raise ValueError(f"0 to {KEPT} pairs are expected, not {count}")
        self._pairs = [(x, y) for x, y in unpacked(state["pairs"], count, 2, self._size)]
