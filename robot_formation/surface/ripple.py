"""Waves: the slope changes sign every half wavelength."""

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
class Ripple(GradientNormal):
    """Straight waves, 3 cm from trough to crest and 60 cm long, with a crest through the plate's middle.

    z = middle + wave_height / 2 cos(2 pi d / wavelength), d the distance from the middle along the waves' direction.
    The steepest slope is pi wave_height / wavelength, 8.9 degrees with the defaults. (3 cm as amplitude would give
    17.4 degrees, at which the default tyres hold a robot in no direction but straight up or down, and crests on which
    the default body, with its ground clearance of 12 mm between axles 22 cm apart, would sit.)
    """

    name: ClassVar[str] = "ripple"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    middle_m: float = parameter(0.065, "height half-way between troughs and crests", unit="m")
    wave_height_m: float = parameter(0.030, "height from trough to crest", unit="m", low=0.0, high=1.0)
    wavelength_m: float = parameter(0.60, "distance from crest to crest", unit="m", low=0.1, high=100.0)
    direction_deg: float = parameter(90.0, "direction across the crests, 0 along x, 90 along y", unit="deg")

    @cached_property
    def _wave(self) -> tuple[float, float, float]:
        """Wave number along x and y (rad/m) and phase of the world's origin."""
        number, direction = 2.0 * math.pi / self.wavelength_m, math.radians(self.direction_deg)
        along_x, along_y = number * math.cos(direction), number * math.sin(direction)
        return along_x, along_y, -0.5 * self.size_m * (along_x + along_y)

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        along_x, along_y, phase = self._wave
        return self.middle_m + 0.5 * self.wave_height_m * math.cos(along_x * x + along_y * y + phase)

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y)."""
        along_x, along_y, phase = self._wave
        steepness = -0.5 * self.wave_height_m * math.sin(along_x * x + along_y * y + phase)
        return (steepness * along_x, steepness * along_y)

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        along_x, along_y, phase = self._wave
        return np.asarray(self.middle_m + 0.5 * self.wave_height_m * np.cos(along_x * xs + along_y * ys + phase))
