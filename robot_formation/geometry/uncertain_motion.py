"""Motions in the plane with a covariance, and how it goes through compositions: to first order, as Smith, Self and
Cheeseman compound uncertain transforms (Autonomous Robot Vehicles, 1990).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.se2 import Motion

Matrix = NDArray[np.float64]

EXACT = (0.0,) * 9
"""Covariance of what is taken for exact."""
TURN_UNKNOWN = (*EXACT[:-1], -1.0)
"""Covariance of a motion whose turn isn't known: its place is taken for exact."""


@dataclass(frozen=True)
class UncertainMotion:
    """A motion and the covariance of (x, y, yaw), row by row: m^2, m rad, rad^2.

    A negative variance of the yaw says that the turn isn't known; `mean` then has yaw 0.
    """

    mean: Motion
    covariance: tuple[float, ...] = EXACT

    @classmethod
    def of(cls, mean: Motion, covariance: Matrix) -> UncertainMotion:
        """Make one of a covariance (3, 3)."""
        return cls(mean, tuple(covariance.ravel().tolist()))

    @property
    def matrix(self) -> Matrix:
        """The covariance (3, 3) of (x, y, yaw); a turn that isn't known is taken for exact."""
        found = np.array(self.covariance).reshape(3, 3)
        if not self.turn_known:
            found[2, 2] = 0.0
        return found

    @property
    def turn_known(self) -> bool:
        """Whether anything is known of the turn."""
        return self.covariance[-1] >= 0.0

    @property
    def finite(self) -> bool:
        """Whether mean and covariance hold neither NaN nor infinity."""
        return self.mean.finite and all(map(math.isfinite, self.covariance))

    def then(self, other: UncertainMotion) -> UncertainMotion:
        """Compose with another motion, whose errors are independent of this one's."""
        first, second = composition_jacobians(self.mean, other.mean)
        covariance = first @ self.matrix @ first.T + second @ other.matrix @ second.T
        return UncertainMotion.of(self.mean.then(other.mean), covariance)

    def after(self, motion: Motion) -> UncertainMotion:
        """Return what is left of this way after a motion, taken for exact, from its start."""
        return UncertainMotion(motion.inverse()).then(self)

    def between(self, before: Motion, after: Motion) -> UncertainMotion:
        """Compose `before`, this motion and `after`, where the two are exact."""
        return UncertainMotion(before).then(self).then(UncertainMotion(after))


def composition_jacobians(first: Motion, second: Motion) -> tuple[Matrix, Matrix]:
    """Return the derivatives (3, 3) of `first.then(second)` by (x, y, yaw) of the first and of the second."""
    cosine, sine = math.cos(first.yaw_rad), math.sin(first.yaw_rad)
    x, y = second.x_m, second.y_m
    by_first = np.array([[1.0, 0.0, -sine * x - cosine * y], [0.0, 1.0, cosine * x - sine * y], [0.0, 0.0, 1.0]])
    by_second = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return by_first, by_second


def covariance_xy(covariance_uv: Matrix) -> tuple[float, ...]:
    """Turn a covariance (3, 3) of (u, v, turn) into that of (x, y, yaw), row by row: x = v, y = -u."""
    return tuple((_TO_XY @ covariance_uv @ _TO_XY.T).ravel().tolist())


def covariance_uv(covariance: Sequence[float]) -> Matrix:
    """Turn a covariance of (x, y, yaw), row by row, into that of (u, v, turn) (3, 3)."""
    return np.asarray(_TO_XY.T @ np.reshape(covariance, (3, 3)) @ _TO_XY)


_TO_XY = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
