"""The paper's plate: a paraboloid."""

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
class Bowl(GradientNormal):
    """Paraboloid z = lowest + curvature r^2 about the plate's middle.

    The paper states 50 mm at the lowest point and 208.4 mm at the corners of a 1780 mm square, which is
    z = 50 + r^2 / 10000 [mm]; the formula that it prints is a cone and doesn't give these heights.
    """

    name: ClassVar[str] = "bowl"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    lowest_m: float = parameter(0.050, "height of the lowest point, the plate's middle", unit="m")
    curvature_per_m: float = parameter(0.1, "height gained per squared distance from the middle", unit="1/m")

    @cached_property
    def paraboloid(self) -> Paraboloid:
        """The same in plain numbers."""
        return Paraboloid(0.5 * self.size_m, self.lowest_m, self.curvature_per_m, 1.0)

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        return self.paraboloid.height(x, y)

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y)."""
        return (self.paraboloid.slope_x(x), self.paraboloid.slope_y(y))

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        middle = 0.5 * self.size_m
        return np.asarray(self.lowest_m + self.curvature_per_m * ((xs - middle) ** 2 + (ys - middle) ** 2))
