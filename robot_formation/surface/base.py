"""What the rest of the package needs to know of the ground."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

PLATE_SIZE_M = 1.78
"""Edge of the square plate (paper, section 'Manifold')."""


@runtime_checkable
class Surface(Protocol):
    """Ground z = height(x, y) in the world frame, smooth, defined for every x and y (also beyond the plate's edge).

    The scalar methods take and return plain Python floats: the traction law calls them many times per physics step.
    """

    @property
    def name(self) -> str:
        """Name in the registry."""

    @property
    def size_m(self) -> float:
        """Edge of the square plate, metres; its corners are (0, 0) and (size_m, size_m)."""

    def height(self, x: float, y: float) -> float:
        """Height above the world's origin at (x, y), all in metres."""

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y), metres per metre."""

    def normal(self, x: float, y: float) -> tuple[float, float, float]:
        """Unit normal that points up, world frame."""

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y (any shapes that broadcast), for meshes and figures."""


class GradientNormal:
    """Gives `normal` to a surface that has `gradient`."""

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y), metres per metre."""
        raise NotImplementedError

    def normal(self, x: float, y: float) -> tuple[float, float, float]:
        """Unit normal that points up, world frame."""
        slope_x, slope_y = self.gradient(x, y)
        scale = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        return (-slope_x * scale, -slope_y * scale, scale)
