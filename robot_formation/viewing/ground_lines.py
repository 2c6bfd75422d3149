"""What is drawn on the ground: contour lines of its mesh, and lines that follow it."""

from __future__ import annotations

import numpy as np
from matplotlib.tri import LinearTriInterpolator, Triangulation
from numpy.typing import NDArray

from robot_formation.analysis.run_record import Ground

Array = NDArray[np.float64]

_LEVELS = 9
_FLAT_M = 1e-6


def contour_lines(ground: Ground, levels: int = _LEVELS) -> list[tuple[float, Array]]:
    """Cut a mesh at heights that divide its range evenly: marching triangles.

    Returns:
        Each height [m] with its segments (n, 2, 3), whose ends lie on the mesh's edges; none for level ground.
    """
    low, high = float(ground.vertices_m[:, 2].min()), float(ground.vertices_m[:, 2].max())
    if high - low < _FLAT_M:
        return []
    heights = np.linspace(low, high, levels + 2)[1:-1]
    return [(float(height), _cut(ground, float(height))) for height in heights]


def _cut(ground: Ground, height_m: float) -> Array:
    corners = ground.vertices_m[ground.triangles]  # (m, 3, 3)
    above = corners[:, :, 2] > height_m
    crossed = above.any(axis=1) & ~above.all(axis=1)
    corners, above = corners[crossed], above[crossed]
    # One corner lies alone on its side of the cut, which crosses the two edges that meet in it.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(corners))
    tip = corners[rows, alone]
    ends = []
    for step in (1, 2):
        other = corners[rows, (alone + step) % 3]
        share = (height_m - tip[:, 2]) / (other[:, 2] - tip[:, 2])
        ends.append(tip + share[:, None] * (other - tip))
    return np.stack(ends, axis=1)


class GroundHeight:
    """Heights of a mesh's surface, metres; level ground at 0 without one, and beside it."""

    def __init__(self, ground: Ground | None = None) -> None:
        self._interpolate: LinearTriInterpolator | None = None
        if ground is not None:
            x_m, y_m, z_m = ground.vertices_m.T
            self._interpolate = LinearTriInterpolator(Triangulation(x_m, y_m, ground.triangles), z_m)

    def of(self, points_m: Array) -> Array:
        """Return the heights (n,) below points (n, 2)."""
        if self._interpolate is None:
            return np.zeros(len(points_m))
        return np.asarray(self._interpolate(points_m[:, 0], points_m[:, 1]).filled(0.0), float)

    def on_ground(self, points_m: Array, above_m: float = 0.0) -> Array:
        """Put points (n, 2) on the ground, or so far above it; return them (n, 3)."""
        return np.column_stack([points_m, self.of(points_m) + above_m])
