"""Poses in space, and how a robot stands on the ground."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.orientation import Quaternion, Vector, pitch_rad, quaternion, roll_rad, rotate, yaw_rad
from robot_formation.geometry.se2 import Motion
from robot_formation.surface import Surface


@dataclass(frozen=True)
class Pose:
    """Where a frame is in the world: position in metres, orientation as a unit quaternion (x, y, z, w)."""

    position: Vector
    orientation: Quaternion

    @property
    def yaw_rad(self) -> float:
        """Heading: direction of the x axis seen from above, counter-clockwise from world x."""
        return yaw_rad(self.orientation)

    @property
    def pitch_rad(self) -> float:
        """Rotation about y after yaw, positive nose down (REP-103)."""
        return pitch_rad(self.orientation)

    @property
    def roll_rad(self) -> float:
        """Rotation about x after yaw and pitch, positive right side down (REP-103)."""
        return roll_rad(self.orientation)

    @property
    def planar(self) -> Motion:
        """The pose seen from above: world x, y and heading."""
        return Motion(self.position[0], self.position[1], self.yaw_rad)

    def place(self, point: Vector) -> Vector:
        """World coordinates of a point of the frame, metres."""
        x, y, z = rotate(self.orientation, point)
        return (self.position[0] + x, self.position[1] + y, self.position[2] + z)

    def matrix(self) -> NDArray[np.float64]:
        """Rotation matrix (3, 3), read-only: columns are the frame's axes in the world."""
        return self._matrix

    @functools.cached_property
    def _matrix(self) -> NDArray[np.float64]:
        # A chain's cameras ask again and again for the poses of the same standing robots.
        x, y, z, w = self.orientation
        matrix = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        matrix.setflags(write=False)
        return matrix


def off_plate(surface: Surface, robot: Pose, dot_height_m: float) -> tuple[float, float] | None:
    """World x and y of a robot's reference dot if that lies, seen from above, beyond the plate's edge; else None.

    The wheels may stand beside the plate: the ground's formula goes on there.
    """
    x, y, _ = robot.place((0.0, 0.0, dot_height_m))
    return None if 0.0 <= x <= surface.size_m and 0.0 <= y <= surface.size_m else (x, y)


def pose_on_surface(
    surface: Surface, x_m: float, y_m: float, heading_rad: float, *, wheelbase_m: float = 0.22, track_m: float = 0.19
) -> Pose:
    """Pose of base_link for a robot that stands with its four wheels on the surface.

    Roll, pitch and height come from the ground under the wheels, so on a hollow the origin hangs a little above it.
    """
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    a, b = 0.5 * wheelbase_m, 0.5 * track_m
    corners = ((a, b), (a, -b), (-a, b), (-a, -b))
    fl, fr, rl, rr = (surface.height(x_m + c * p - s * q, y_m + s * p + c * q) for p, q in corners)
    along = (fl + fr - rl - rr) / (4.0 * a)
    across = (fl + rl - fr - rr) / (4.0 * b)
    pitch = -math.atan(along)
    roll = math.atan(across * math.cos(pitch))
    return Pose((x_m, y_m, 0.25 * (fl + fr + rl + rr)), quaternion(roll, pitch, heading_rad))
