"""Level ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal


@dataclass(frozen=True)
class Plane(GradientNormal):
    """Level plane z = height_m."""

    name: ClassVar[str] = "plane"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    height_m: float = parameter(0.0, "height of the plane", unit="m")

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        return self.height_m

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y): zero."""
        return (0.0, 0.0)

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        return np.full(np.broadcast(xs, ys).shape, self.height_m)
