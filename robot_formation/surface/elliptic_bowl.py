"""A bowl that is steeper one way than the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal


@dataclass(frozen=True)
class EllipticBowl(GradientNormal):
    """Elliptic paraboloid about the plate's middle, with a curvature of its own along x and along y.

    z = lowest + curvature_x x^2 + curvature_y y^2, x and y counted from the middle. Level curves are ellipses, so
    robots side by side stand on different slopes. Steepest in a corner: 12.6 degrees with the defaults.
    """

    name: ClassVar[str] = "elliptic_bowl"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    lowest_m: float = parameter(0.050, "height of the lowest point, the plate's middle", unit="m")
    curvature_x_per_m: float = parameter(0.06, "height gained per squared distance along x", unit="1/m")
    curvature_y_per_m: float = parameter(0.11, "height gained per squared distance along y", unit="1/m")

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        middle = 0.5 * self.size_m
        x -= middle
        y -= middle
        return self.lowest_m + self.curvature_x_per_m * x * x + self.curvature_y_per_m * y * y

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y)."""
        middle = 0.5 * self.size_m
        return (2.0 * self.curvature_x_per_m * (x - middle), 2.0 * self.curvature_y_per_m * (y - middle))

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        middle = 0.5 * self.size_m
        along_x = self.curvature_x_per_m * (xs - middle) ** 2
        return np.asarray(self.lowest_m + along_x + self.curvature_y_per_m * (ys - middle) ** 2)
