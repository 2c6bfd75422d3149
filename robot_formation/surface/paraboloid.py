"""Height and slopes of a paraboloid in plain numbers: physics asks for them a dozen times a step and robot.

Where there is a C compiler this is compiled, with the types of paraboloid.pxd.
"""

from __future__ import annotations


class Paraboloid:
    """z = height at the middle + curvature (dx^2 + sense dy^2), dx and dy counted from the middle, all in metres.

    Args:
        middle_m: x and y of the middle.
        height_m: there.
        curvature_per_m: 1/m.
        sense: 1 for a bowl, -1 for a saddle.
    """

    def __init__(self, middle_m: float, height_m: float, curvature_per_m: float, sense: float) -> None:
        self._middle = middle_m
        self._height = height_m
        self._curvature = curvature_per_m
        self._double = 2.0 * curvature_per_m
        self._sense = sense

    def height(self, x: float, y: float) -> float:
        """Height at (x, y)."""
        dx = x - self._middle
        dy = y - self._middle
        return self._height + self._curvature * (dx * dx + self._sense * (dy * dy))

    def slope_x(self, x: float) -> float:
        """Slope dz/dx."""
        return self._double * (x - self._middle)

    def slope_y(self, y: float) -> float:
        """Slope dz/dy."""
        return self._sense * (self._double * (y - self._middle))
