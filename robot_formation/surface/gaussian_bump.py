"""A single round hill, or a hollow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal


@dataclass(frozen=True)
class GaussianBump(GradientNormal):
    """Gaussian bump on a level plate: z = base + height exp(-r^2 / (2 radius^2)).

    Steepest at r = radius: slope 0.607 height / radius, 9.8 degrees with the defaults. A negative height makes a pit.
    """

    name: ClassVar[str] = "gaussian_bump"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    base_m: float = parameter(0.050, "height far from the bump", unit="m")
    height_m: float = parameter(0.100, "height of the bump above the base", unit="m", low=-1.0, high=1.0)
    radius_m: float = parameter(0.35, "standard deviation of the bump", unit="m", low=0.05, high=100.0)
    centre_x_m: float = parameter(0.5 * PLATE_SIZE_M, "top of the bump", unit="m")
    centre_y_m: float = parameter(0.5 * PLATE_SIZE_M, "top of the bump", unit="m")

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        x -= self.centre_x_m
        y -= self.centre_y_m
        return self.base_m + self.height_m * math.exp(-0.5 * (x * x + y * y) / (self.radius_m * self.radius_m))

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y)."""
        x -= self.centre_x_m
        y -= self.centre_y_m
        square = self.radius_m * self.radius_m
        factor = -self.height_m / square * math.exp(-0.5 * (x * x + y * y) / square)
        return (factor * x, factor * y)

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        squares = (xs - self.centre_x_m) ** 2 + (ys - self.centre_y_m) ** 2
        return np.asarray(self.base_m + self.height_m * np.exp(-0.5 * squares / self.radius_m**2))
