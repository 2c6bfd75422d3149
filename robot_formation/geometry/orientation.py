"""Orientations in space as unit quaternions (x, y, z, w), in the order of ROS messages."""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Unit quaternion (x, y, z, w) of fixed-axis roll, pitch, yaw in radians."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def yaw_rad(orientation: Quaternion) -> float:
    """Heading: direction of the x axis seen from above, anticlockwise from the outer frame's x."""
    x, y, z, w = orientation
    return math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


def pitch_rad(orientation: Quaternion) -> float:
    """Rotation about y after yaw, positive nose down (REP-103)."""
    x, y, z, w = orientation
    return math.asin(max(-1.0, min(1.0, 2.0 * (w * y - x * z))))


def roll_rad(orientation: Quaternion) -> float:
    """Rotation about x after yaw and pitch, positive right side down (REP-103)."""
    x, y, z, w = orientation
    return math.atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))


def rotate(orientation: Quaternion, vector: Vector) -> Vector:
    """Rotate a vector by a unit quaternion."""
    x, y, z, w = orientation
    a, b, c = vector
    # v + w t + q x t with t = 2 q x v
    t_x, t_y, t_z = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (a + w * t_x + y * t_z - z * t_y, b + w * t_y + z * t_x - x * t_z, c + w * t_z + x * t_y - y * t_x)


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Orientation of a frame that has the orientation `second` in a frame with the orientation `first`."""
    x, y, z, w = first
    a, b, c, d = second
    return (
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    )
