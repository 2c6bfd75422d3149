"""Ground from a file, smooth enough for wheels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import ParameterError, parameter
from robot_formation.paths import config_dir
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal
from robot_formation.surface.height_file import read_heights

EXAMPLE = "heightmap.png"
"""The example in config/."""
MAX_HEIGHT_M = 1000.0

# Polynomial coefficients (rows: 1, s, s^2, s^3) of four neighbouring samples at -1, 0, 1, 2: Catmull-Rom.
_INSIDE = np.array([[0.0, 1.0, 0.0, 0.0], [-0.5, 0.0, 0.5, 0.0], [1.0, -2.5, 2.0, -0.5], [-0.5, 1.5, -1.5, 0.5]])
# Straight on past the first sample (s counted from it), and past the last one.
_BEFORE = np.array([[0.0, 1.0, 0.0, 0.0], [-0.5, 0.0, 0.5, 0.0], [0.0] * 4, [0.0] * 4])
_AFTER = np.array([[0.0, 0.0, 1.0, 0.0], [0.0, -0.5, 0.0, 0.5], [0.0] * 4, [0.0] * 4])


@dataclass(frozen=True)
class Heightmap(GradientNormal):
    """Height map from a 16-bit PNG or an NPY file, stretched over the plate.

    Between the samples a bicubic Catmull-Rom interpolation (R. Keys, IEEE Trans. ASSP 29, 1981): the gradient is
    continuous, and grids of quadratic surfaces are met exactly. Past the edge the ground goes straight on. A cell's
    16 coefficients are worked out when a wheel first enters it.

    Raises:
        ParameterError: on a file that can't be used (`read_heights`).
    """

    name: ClassVar[str] = "heightmap"
    size_m: float = parameter(PLATE_SIZE_M, "edge of the square plate", unit="m", low=0.1, high=100.0)
    file: str = parameter("", "16-bit grey PNG (top row: largest y) or NPY ([y, x]); empty: config/heightmap.png")
    scale_m: float = parameter(0.15, "height of full scale: 65535, or 1.0 in floating point", unit="m")
    base_m: float = parameter(0.050, "height of the value 0", unit="m")

    def __post_init__(self) -> None:
        """Read the file, so that a bad one is refused at once."""
        highest = float(np.abs(self._samples).max())
        if not highest <= MAX_HEIGHT_M:
            raise ParameterError(
                f"surface 'heightmap': reaches heights of {highest:.3g} m, beyond {MAX_HEIGHT_M:g} m; "
                f"choose scale_m (now {self.scale_m:g}) to suit the file"
            )

    @cached_property
    def _samples(self) -> NDArray[np.float64]:
        """Heights (n + 2, n + 2) in metres, [y, x], with a ring around them that continues them as quadratics."""
        values = read_heights(Path(self.file) if self.file else config_dir() / EXAMPLE)
        with np.errstate(over="ignore", invalid="ignore"):
            padded = np.pad(self.base_m + self.scale_m * values, 1)
            for ring in (padded[:, 1:-1], padded.T):  # columns first, then rows with the corners
                ring[0] = 3.0 * (ring[1] - ring[2]) + ring[3]
                ring[-1] = 3.0 * (ring[-2] - ring[-3]) + ring[-4]
        return padded

    @cached_property
    def _cells(self) -> dict[int, tuple[float, ...]]:
        return {}

    @cached_property
    def _grid(self) -> tuple[float, int]:
        """Cells per metre, and the number of samples per edge."""
        samples = len(self._samples) - 2
        return (samples - 1) / self.size_m, samples

    def height(self, x: float, y: float) -> float:
        """Height at (x, y), metres."""
        cell, s, t, _ = self._cell(x, y)
        a3, b3, c3, d3, a2, b2, c2, d2, a1, b1, c1, d1, a0, b0, c0, d0 = cell
        z3, z2 = ((d3 * s + c3) * s + b3) * s + a3, ((d2 * s + c2) * s + b2) * s + a2
        z1, z0 = ((d1 * s + c1) * s + b1) * s + a1, ((d0 * s + c0) * s + b0) * s + a0
        return ((z3 * t + z2) * t + z1) * t + z0

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes (dz/dx, dz/dy) at (x, y)."""
        cell, s, t, per_metre = self._cell(x, y)
        a3, b3, c3, d3, a2, b2, c2, d2, a1, b1, c1, d1, _, b0, c0, d0 = cell
        # As a polynomial of t for the slope along y, and as one of s for that along x.
        z3, z2 = ((d3 * s + c3) * s + b3) * s + a3, ((d2 * s + c2) * s + b2) * s + a2
        z1 = ((d1 * s + c1) * s + b1) * s + a1
        b, c = ((b3 * t + b2) * t + b1) * t + b0, ((c3 * t + c2) * t + c1) * t + c0
        d = ((d3 * t + d2) * t + d1) * t + d0
        return (((3.0 * d * s + 2.0 * c) * s + b) * per_metre, ((3.0 * z3 * t + 2.0 * z2) * t + z1) * per_metre)

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights in metres at arrays of x and y."""
        shape = np.broadcast(xs, ys).shape
        points = zip(np.broadcast_to(xs, shape).ravel(), np.broadcast_to(ys, shape).ravel(), strict=True)
        return np.array([self.height(float(x), float(y)) for x, y in points]).reshape(shape)

    def _cell(self, x: float, y: float) -> tuple[tuple[float, ...], float, float, float]:
        """Coefficients of the cell under (x, y), the place in it along x and y in cells, and cells per metre."""
        per_metre, samples = self._grid
        s, t = x * per_metre, y * per_metre
        last = samples - 1
        column = -1 if s < 0.0 else int(s) if s < last else last
        row = -1 if t < 0.0 else int(t) if t < last else last
        key = row * (samples + 1) + column
        cell = self._cells.get(key)
        if cell is None:
            cell = self._cells[key] = self._coefficients(row, column, last)
        return cell, s - column if column > 0 else s, t - row if row > 0 else t, per_metre

    def _coefficients(self, row: int, column: int, last: int) -> tuple[float, ...]:
        """16 coefficients of a cell: t^3 to 1, each with s^0 to s^3; -1 and `last` are past the edge."""
        first_row, first_column = (min(max(index, 0), last - 1) for index in (row, column))
        patch = self._samples[first_row : first_row + 4, first_column : first_column + 4]
        along_y, along_x = (_BEFORE if i < 0 else _AFTER if i == last else _INSIDE for i in (row, column))
        # Element by element: a matrix product of another library could round differently from run to run.
        table = [[float((patch * np.outer(v, u)).sum()) for u in along_x] for v in along_y[::-1]]
        return tuple(value for line in table for value in line)
