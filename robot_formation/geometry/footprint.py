"""Footprints: robots as rectangles seen from above."""

from __future__ import annotations

import math

from robot_formation.geometry.se2 import Motion


def footprint_gap_m(other: Motion, length_m: float, width_m: float) -> float:
    """Distance of two equal rectangles along their best separating axis, metres; negative if they overlap.

    Two convex bodies are apart just if a direction normal to one of their sides separates them (separating axis
    theorem). Towards a corner the true distance is larger than what this returns, never smaller.

    Args:
        other: pose of the second rectangle's centre in the frame of the first one's, x along the length.
        length_m: length of both.
        width_m: width of both.
    """
    half_length, half_width = 0.5 * length_m, 0.5 * width_m
    cosine, sine = math.cos(other.yaw_rad), math.sin(other.yaw_rad)
    gaps = []
    for x, y in ((1.0, 0.0), (0.0, 1.0), (cosine, sine), (-sine, cosine)):
        own = abs(x) * half_length + abs(y) * half_width
        others = abs(x * cosine + y * sine) * half_length + abs(y * cosine - x * sine) * half_width
        gaps.append(abs(x * other.x_m + y * other.y_m) - own - others)
    return max(gaps)
