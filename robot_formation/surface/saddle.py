"""A saddle: up along one axis, down along the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal
from robot_formation.surface.paraboloid import Paraboloid


@dataclass(frozen=True)
class Saddle(GradientNormal):
    """Hyperbolic paraboloid about the plate's middle, rising along x and falling along y.

    z = middle + curvature (x^2 - y^2), x and y counted from the middle. Steepest in a corner: 14.1 degrees with the
    defaults, as the paper's bowl, but curved against itself.
    """

    name: ClassVar[str] = "saddle"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    middle_m: float = parameter(0.130, "height of the plate's middle", unit="m")
    curvature_per_m: float = parameter(0.1, "height gained along x per squared distance, lost along y", unit="1/m")

    @cached_property
    def paraboloid(self) -> Paraboloid:
        """The same in plain numbers."""
        return Paraboloid(0.5 * self.size_m, self.middle_m, self.curvature_per_m, -1.0)

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        return self.paraboloid.height(x, y)

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y)."""
        return (self.paraboloid.slope_x(x), self.paraboloid.slope_y(y))

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        middle = 0.5 * self.size_m
        return np.asarray(self.middle_m + self.curvature_per_m * ((xs - middle) ** 2 - (ys - middle) ** 2))
