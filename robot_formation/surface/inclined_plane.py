"""A tilted plate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal


@dataclass(frozen=True)
class InclinedPlane(GradientNormal):
    """Plane that rises by a constant slope in one direction."""

    name: ClassVar[str] = "inclined_plane"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    middle_m: float = parameter(0.130, "height of the plate's middle", unit="m")
    slope_deg: float = parameter(5.0, "angle against the level", unit="deg", low=-60.0, high=60.0)
    direction_deg: float = parameter(90.0, "direction uphill, 0 along x, 90 along y", unit="deg")

    @cached_property
    def _slopes(self) -> tuple[float, float]:
        steepness, direction = math.tan(math.radians(self.slope_deg)), math.radians(self.direction_deg)
        return (steepness * math.cos(direction), steepness * math.sin(direction))

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        slope_x, slope_y = self._slopes
        middle = 0.5 * self.size_m
        return self.middle_m + slope_x * (x - middle) + slope_y * (y - middle)

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy): the same everywhere."""
        return self._slopes

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        slope_x, slope_y = self._slopes
        middle = 0.5 * self.size_m
        return np.asarray(self.middle_m + slope_x * (xs - middle) + slope_y * (ys - middle))
