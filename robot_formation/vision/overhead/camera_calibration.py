"""From pixels of the overhead camera to places in the world, by the calibration that the tracker has been given."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.vision.overhead.tracking_parameters import Calibration

Array = NDArray[np.float64]

_ROUNDS = 20
_CLOSE_M = 1e-6
_STANCE_DIRECTIONS = [(math.cos(math.pi * k / 4), math.sin(math.pi * k / 4)) for k in range(8)]
_UNDISTORT_STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-9)


def _undistorted(points: Array, matrix: Array, distortion: Array) -> Array:
    """Directions (n, 1, 2) of pixels (n, 1, 2), iterated until they stand still."""
    if hasattr(cv2, "undistortPointsIter"):  # OpenCV 4, whose undistortPoints ends after five rounds up to 4.6
        unturned = np.eye(3)
        return np.asarray(cv2.undistortPointsIter(points, matrix, distortion, unturned, unturned, _UNDISTORT_STOP))
    return np.asarray(cv2.undistortPoints(points, matrix, distortion, criteria=_UNDISTORT_STOP))


class Locator:
    """Gives the place in the world of a reference dot seen at a pixel."""

    def __init__(self, calibration: Calibration, surface: Surface, dot_height_m: float) -> None:
        c = calibration
        self.calibration = c
        self._surface = surface
        self._dot_height_m = dot_height_m
        self._matrix = np.array(
            [[c.focal_length_px, 0.0, c.centre_x_px], [0.0, c.focal_length_px, c.centre_y_px], [0.0, 0.0, 1.0]]
        )
        self._distortion = np.array([c.k1, c.k2, c.p1, c.p2, c.k3])

    def places(self, pixels: Array) -> Array:
        """World places (n, 3) in metres of dots at pixels (n, 2) (column, row): where their rays meet their height."""
        if len(pixels) == 0:
            return np.empty((0, 3))
        points = np.asarray(pixels, float).reshape(-1, 1, 2)
        rays = _undistorted(points, self._matrix, self._distortion).reshape(-1, 2)
        return np.array([self._meet(float(x), -float(y)) for x, y in rays])

    def place_of(self, x_m: float, y_m: float) -> Array:
        """Place (3,) of the dot of a robot whose base_link is at (x, y)."""
        return np.array(self._dot(x_m, y_m))

    def area_px(self, place: Array, radius_m: float) -> float:
        """Expected area of a dot's picture, pixels."""
        scale = self.calibration.focal_length_px / max(0.1, self.calibration.z_m - float(place[2]))
        return math.pi * (radius_m * scale) ** 2

    def _meet(self, slope_x: float, slope_y: float) -> tuple[float, float, float]:
        """Follow a ray (metres sideways per metre down) to the dot's height.

        The height depends on the place; as the ray is steep and the ground is not, each round cuts the error to a
        tenth or less.
        """
        c = self.calibration
        base_x, base_y = c.x_m, c.y_m
        x, y, z = self._dot(base_x, base_y)
        for _ in range(_ROUNDS):
            seen_x, seen_y = c.x_m + (c.z_m - z) * slope_x, c.y_m + (c.z_m - z) * slope_y
            off_x, off_y = seen_x - x, seen_y - y
            if abs(off_x) + abs(off_y) < _CLOSE_M:
                break
            base_x, base_y = base_x + off_x, base_y + off_y
            x, y, z = self._dot(base_x, base_y)
        return (c.x_m + (c.z_m - z) * slope_x, c.y_m + (c.z_m - z) * slope_y, z)

    def _dot(self, base_x: float, base_y: float) -> tuple[float, float, float]:
        c = self.calibration
        if not c.knows_surface:
            return (base_x, base_y, c.plane_m + self._dot_height_m)
        ground = sum(
            self._surface.height(base_x + c.stance_m * dx, base_y + c.stance_m * dy) for dx, dy in _STANCE_DIRECTIONS
        ) / len(_STANCE_DIRECTIONS)
        n_x, n_y, n_z = self._surface.normal(base_x, base_y)
        d = self._dot_height_m
        return (base_x + d * n_x, base_y + d * n_y, ground + d * n_z)
