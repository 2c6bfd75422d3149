"""Footprints: robots as rectangles seen from above."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.se2 import Motion

Array = NDArray[np.float64]
N = TypeVar("N", float, Array)


def footprint_gap_m(other: Motion, length_m: float, width_m: float) -> float:
    """Distance of two equal rectangles along their best separating axis, metres; negative if they overlap.

    Two convex bodies are apart just if a direction normal to one of their sides separates them (separating axis
    theorem). Towards a corner the true distance is larger than what this returns, never smaller.

    Args:
        other: pose of the second rectangle's centre in the frame of the first one's, x along the length.
        length_m: length of both.
        width_m: width of both.
    """
    cosine, sine = math.cos(other.yaw_rad), math.sin(other.yaw_rad)
    return max(_separations(other.x_m, other.y_m, cosine, sine, length_m, width_m))


def footprint_gaps_m(own: Array, others: Array, length_m: float, width_m: float) -> Array:
    """Gaps (n,) of pairs of equal rectangles as `footprint_gap_m` has them, metres.

    Args:
        own: centres x, y [m] and headings [rad] of the first ones in any frame, (n, 3).
        others: those of the second ones.
        length_m: length of all.
        width_m: width of all.
    """
    x, y = others[:, 0] - own[:, 0], others[:, 1] - own[:, 1]
    ahead, left = np.cos(own[:, 2]), np.sin(own[:, 2])
    turn = others[:, 2] - own[:, 2]
    inside = (ahead * x + left * y, ahead * y - left * x)
    return np.asarray(np.max(_separations(*inside, np.cos(turn), np.sin(turn), length_m, width_m), axis=0))


def _separations(x: N, y: N, cosine: N, sine: N, length_m: float, width_m: float) -> list[N]:
    """Gaps along the normals of the four sides; the second rectangle's place and heading are in the first one's frame.

    Args:
        x: ahead of the first one.
        y: to its left.
        cosine: of the second one's heading.
        sine: of the same.
        length_m: length of both.
        width_m: width of both.
    """
    half_length, half_width = 0.5 * length_m, 0.5 * width_m
    gaps: list[N] = []
    normals: tuple[tuple[Any, Any], ...] = ((1.0, 0.0), (0.0, 1.0), (cosine, sine), (-sine, cosine))
    for ahead, left in normals:
        own = abs(ahead) * half_length + abs(left) * half_width
        others = abs(ahead * cosine + left * sine) * half_length + abs(left * cosine - ahead * sine) * half_width
        gaps.append(abs(ahead * x + left * y) - own - others)
    return gaps
