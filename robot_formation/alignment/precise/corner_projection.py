"""The marker's corners in the follower's picture, and edges between them, for many states of the neighbour at once.

Where there is a C compiler this is compiled, with the types of corner_projection.pxd.
"""

from __future__ import annotations

import math
from typing import Any

LEFT, RIGHT, UPPER, LOWER, WIDTH = range(5)
"""What is read of a face: one of the sides that the detector reports, or its width between the middles of two edges."""
CORNERS = 8


class CornerProjection:
    """Projects corners of the neighbour's marker into the follower's camera, which looks to the left.

    Args:
        corners: the cube's corners in the neighbour's base_link, (8, 3) m.
        lens_y_m: lens in the follower's base_link.
        lens_z_m: the same.
        focal_length_px: of the lens.
        centre_x_px: column of the optical axis.
        centre_y_px: row of the optical axis.
        least_depth_m: depth at which points beside or behind the lens are taken to lie.
    """

    def __init__(
        self,
        corners: memoryview[Any],
        lens_y_m: float,
        lens_z_m: float,
        focal_length_px: float,
        centre_x_px: float,
        centre_y_px: float,
        least_depth_m: float,
    ) -> None:
        self._corners = corners
        self._lens_y = lens_y_m
        self._lens_z = lens_z_m
        self._focal_length = focal_length_px
        self._centre_x = centre_x_px
        self._centre_y = centre_y_px
        self._least_depth = least_depth_m

    def project(self, states: memoryview[Any], pixels: memoryview[Any]) -> None:
        """Project all corners.

        Args:
            states: (n, 6), see `marker_projection`: x, y, yaw; the ground's mean curvature, its difference, its mixed
                part.
            pixels: takes columns and rows, (n, 8, 2).
        """
        for number in range(len(states)):
            x = states[number, 0]
            y = states[number, 1]
            cosine = math.cos(states[number, 2])
            sine = math.sin(states[number, 2])
            mean = states[number, 3]
            more = states[number, 4]
            mixed = states[number, 5]
            # Half of the relative tilt (`relative_tilt`): between the follower and the plane, and again from there on.
            roll = 0.5 * ((mean + more) * y + mixed * x)
            pitch = -0.5 * ((mean - more) * x + mixed * y)
            cr = math.cos(roll)
            sr = math.sin(roll)
            cp = math.cos(pitch)
            sp = math.sin(pitch)
            for corner in range(CORNERS):
                a = cosine * self._corners[corner, 0] - sine * self._corners[corner, 1]
                b = sine * self._corners[corner, 0] + cosine * self._corners[corner, 1]
                c = self._corners[corner, 2]
                # Tilted by roll, then by pitch, and moved; then tilted again.
                d = sr * b + cr * c
                ahead = cp * a + sp * d + x
                beside = cr * b - sr * c + y
                above = cp * d - sp * a
                d = sr * beside + cr * above
                scale = self._focal_length / max(cr * beside - sr * above - self._lens_y, self._least_depth)
                pixels[number, corner, 0] = self._centre_x + (cp * ahead + sp * d) * scale
                pixels[number, corner, 1] = self._centre_y - (cp * d - sp * ahead - self._lens_z) * scale


def read_edges(
    pixels: memoryview[Any],
    corners: memoryview[Any],
    kinds: memoryview[Any],
    row_inset_px: float,
    found: memoryview[Any],
) -> None:
    """Read edges from projected corners.

    Args:
        pixels: of `CornerProjection.project`, (n, 8, 2).
        corners: numbers of the corners at both ends of each edge, (m, 4); of a WIDTH, of the right edge and of the left
            one.
        kinds: LEFT, RIGHT, UPPER, LOWER or WIDTH, of each edge.
        row_inset_px: columns that a slanting edge must leave in a row for the detector to report it.
        found: takes the edges, (n, m) px.
    """
    for edge in range(len(kinds)):
        kind = kinds[edge]
        first = corners[edge, 0]
        second = corners[edge, 1]
        for number in range(len(pixels)):
            one = pixels[number, first, 0]
            other = pixels[number, second, 0]
            if kind == LEFT:
                found[number, edge] = min(one, other)
            elif kind == RIGHT:
                found[number, edge] = max(one, other)
            elif kind == WIDTH:
                left = pixels[number, corners[edge, 2], 0] + pixels[number, corners[edge, 3], 0]
                found[number, edge] = 0.5 * (one + other) - 0.5 * left
            else:
                end = pixels[number, first, 1]
                farther = pixels[number, second, 1]
                if (end > farther) == (kind == UPPER):
                    end, farther = farther, end
                share = min(1.0, row_inset_px / max(abs(other - one), 1.0))
                found[number, edge] = end + (farther - end) * share
