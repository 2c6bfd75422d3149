"""Models that forecast by a finite-dimensional Koopman operator K, learned from pairs of displacements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robot_formation.koopman.online_dmd import OnlineDMD
from robot_formation.koopman.predictors.models import Insight, Matrix, Vector
from robot_formation.koopman.predictors.parameters import PredictorParameters

# An open-loop power of K may grow as it likes; this is far beyond any forecast and far below overflow.
_LARGEST_STATE_M = 1e100


class Literal:
    """The paper's Algorithm 1 as printed: K from the first three displacements, then K^n x_3, blind to what follows.

    The printed loop feeds its own forecast back as the measurement, so its innovation y - K x is zero and K stays.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._collected: list[Vector] = []
        self._k: Matrix | None = None
        self._state: Vector = np.zeros(2)

    def observe(self, x: Vector) -> None:
        """See `Model`; from the fourth on only the number of observations matters."""
        if self._k is not None:
            self._state = np.clip(self._k @ self._state, -_LARGEST_STATE_M, _LARGEST_STATE_M)
            return
        self._collected.append(x)
        self._state = x
        if len(self._collected) == 3:
            data = np.column_stack(self._collected)
            self._k = data[:, 1:] @ np.linalg.pinv(data[:, :-1])

    def forecast(self) -> Vector:
        """See `Model`."""
        return self._state if self._k is None else self._k @ self._state

    def insight(self) -> Insight:
        """See `Model`."""
        condition = None
        if self._k is not None:
            condition = float(np.linalg.cond(np.column_stack(self._collected[:-1])))
        return Insight(k=self._k, condition_number=condition)


class Measured:
    """Online DMD with measured pairs: what the paper's algorithm must have been to react to anything.

    Forecast K x_t, with K the least-squares fit of all pairs (x_i, x_i+1) so far; the previous displacement until the
    first two pairs are complete, as in the paper's collection phase.
    """

    def __init__(self, parameters: PredictorParameters) -> None:
        self._dmd = OnlineDMD(2, forgetting=parameters.forgetting)
        self._pairs = 0
        self._last: Vector | None = None
        self._innovation: Vector | None = None

    def observe(self, x: Vector) -> None:
        """See `Model`."""
        if self._last is not None:
            self._innovation = self._dmd.update(self._last, x)
            self._pairs += 1
        self._last = x

    def forecast(self) -> Vector:
        """See `Model`."""
        assert self._last is not None  # by the protocol
        return self._last if self._pairs < 2 else self._dmd.k @ self._last

    def insight(self) -> Insight:
        """See `Model`."""
        if self._pairs < 2:
            return Insight()
        return Insight(self._dmd.k, self._dmd.condition_number, self._innovation)
