"""Where the beacon neighbour stands as its follower sees it, and which picture of the marker that gives.

Both robots stand on curved ground. Their origins are taken to lie in one plane halfway between their tilts (a chord of
the ground): the follower is tilted by half of the relative tilt one way, its neighbour by half of it the other way. So
the relative tilt follows from the rows of the picture, and distances are those between the origins, as the formation
error's are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.alignment.precise.corner_projection import (
    CORNERS,
    LEFT,
    LOWER,
    RIGHT,
    UPPER,
    WIDTH,
    CornerProjection,
    read_edges,
)
from robot_formation.alignment.precise.marker_edges import Edge
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import parameter
from robot_formation.vision.marker import Face

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

X, Y, YAW, CURVATURE, SADDLE, SKEW = range(6)
"""State of the neighbour in the follower's level frame: x, y [m], yaw [rad]; the ground's curvature [1/m], by which the
robots are tilted towards each other: its mean, half of what it is more along y than along x, and its mixed part."""
SIZE = 6

_CORNERS = {
    (Face.TARGET, "left"): [0, 1],
    (Face.TARGET, "right"): [2, 3],
    (Face.FRONT, "left"): [2, 3],
    (Face.FRONT, "right"): [4, 5],
    (Face.REAR, "left"): [6, 7],
    (Face.REAR, "right"): [0, 1],
    (Face.TARGET, "top"): [1, 3],
    (Face.TARGET, "bottom"): [0, 2],
    (Face.FRONT, "top"): [3, 5],
    (Face.FRONT, "bottom"): [2, 4],
    (Face.REAR, "top"): [1, 7],
    (Face.REAR, "bottom"): [0, 6],
}
"""Numbers of the cube's corners in `MarkerModel` that are the ends of each edge."""
_UPRIGHT = {edge: ends for edge, ends in _CORNERS.items() if edge[1] in ("left", "right")}
_KINDS = {"left": LEFT, "right": RIGHT, "top": UPPER, "bottom": LOWER}
_LEAST_DEPTH_M = 0.03
"""Depth at which points beside or behind the lens are taken to lie; bodies that touch leave it more than 20 cm."""


@dataclass(frozen=True)
class GeometryParameters:
    """Camera and marker as built."""

    focal_length_px: float = parameter(273.7, "Focal length", unit="px", low=10.0, high=1e4)
    centre_x_px: float = parameter(157.5, "Column of the optical axis", unit="px", low=0.0, high=1e4)
    centre_y_px: float = parameter(103.5, "Row of the optical axis", unit="px", low=0.0, high=1e4)
    lens_y_m: float = parameter(-0.038, "Lens in base_link", unit="m", low=-1.0, high=1.0)
    lens_z_m: float = parameter(0.126, "Lens in base_link", unit="m", low=0.0, high=2.0)
    row_inset_px: float = parameter(
        7.0,
        "Columns that a slanting edge must leave in a row for the detector to report it",
        unit="px",
        low=0.0,
        high=50.0,
    )
    marker_edge_m: float = parameter(0.06, "Edge of the marker's cube", unit="m", low=0.005, high=1.0)
    marker_top_m: float = parameter(0.216, "Height of the marker's top", unit="m", low=0.01, high=2.0)


class MarkerModel:
    """Projects the neighbour's marker into the follower's camera, which looks to the left."""

    def __init__(self, parameters: GeometryParameters) -> None:
        self.parameters = p = parameters
        half, low = p.marker_edge_m / 2.0, p.marker_top_m - p.marker_edge_m
        ground = ((-half, -half), (half, -half), (half, half), (-half, half))
        self._projection = CornerProjection(
            np.array([(x, y, z) for x, y in ground for z in (low, p.marker_top_m)]).data,
            p.lens_y_m,
            p.lens_z_m,
            p.focal_length_px,
            p.centre_x_px,
            p.centre_y_px,
            _LEAST_DEPTH_M,
        )

    def pixels(self, states: Matrix) -> Matrix:
        """Project the cube's corners for states (n, 6); returns columns and rows, (n, 8, 2) px."""
        pixels = np.empty((len(states), CORNERS, 2))
        self._projection.project(np.ascontiguousarray(states, np.float64).data, pixels.data)
        return pixels

    def edges(self, states: Matrix, edges: Sequence[Edge]) -> Matrix:
        """Predict edges for states (n, 6), (n, edges) px."""
        found = np.empty((len(states), len(edges)))
        corners, kinds = _reading(tuple((edge.face, edge.side) for edge in edges))
        if edges:
            read_edges(self.pixels(states).data, corners, kinds, self.parameters.row_inset_px, found.data)
        return found

    def widths(self, state: Vector) -> dict[Face, float]:
        """Return how wide each face appears, px; negative if it is turned away."""
        return self.shown(state, (-math.inf, math.inf))

    def shown(self, state: Vector, limits_px: tuple[float, float]) -> dict[Face, float]:
        """Return how much of each face's width lies between two columns, px; negative if it is turned away."""
        low, high = limits_px
        columns = [min(max(column, low), high) for column in self.pixels(state[None])[0, :, 0].tolist()]
        middle = {edge: 0.5 * sum(columns[corner] for corner in ends) for edge, ends in _UPRIGHT.items()}
        return {face: middle[face, "right"] - middle[face, "left"] for face in Face}

    def place(self, face: Face, column_px: float, height_px: float, yaw: float) -> Vector:
        """Guess the state from a face's column and height and a yaw, without tilt."""
        p = self.parameters
        depth = p.focal_length_px * p.marker_edge_m / max(height_px, 1.0)
        half = p.marker_edge_m / 2.0
        out = {Face.TARGET: (0.0, -half), Face.FRONT: (half, 0.0), Face.REAR: (-half, 0.0)}[face]
        cosine, sine = math.cos(yaw), math.sin(yaw)
        x = (column_px - p.centre_x_px) / p.focal_length_px * depth - (cosine * out[0] - sine * out[1])
        y = depth + p.lens_y_m - (sine * out[0] + cosine * out[1])
        return np.array([x, y, yaw, 0.0, 0.0, 0.0])


def relative_tilt(states: Matrix) -> tuple[Vector, Vector]:
    """Return the neighbour's roll and pitch relative to the follower [rad], each (n,), for states (n, 6).

    On a surface z = p^T S p / 2 about the follower, with S symmetric, the slopes at p are S p.
    """
    mean, more, mixed = (states[:, index] for index in (CURVATURE, SADDLE, SKEW))
    x, y = states[:, X], states[:, Y]
    return (mean + more) * y + mixed * x, -((mean - more) * x + mixed * y)


@lru_cache(maxsize=1024)
def _reading(edges: tuple[tuple[Face, str], ...]) -> tuple[memoryview[Any], memoryview[Any]]:
    """Corners and kinds of edges as `read_edges` takes them."""
    corners = np.zeros((len(edges), 4), np.intp)
    kinds = np.empty(len(edges), np.intp)
    for number, (face, side) in enumerate(edges):
        if side == "width":
            corners[number] = [*_CORNERS[face, "right"], *_CORNERS[face, "left"]]
            kinds[number] = WIDTH
        else:
            corners[number, :2] = _CORNERS[face, side]
            kinds[number] = _KINDS[side]
    return corners.data, kinds.data


def after_motion(state: Vector, motion: Motion) -> Vector:
    """Return the state after the follower's motion."""
    pose = pose_of(state).relative_to(motion)
    c2, s2 = math.cos(2.0 * motion.yaw_rad), math.sin(2.0 * motion.yaw_rad)
    more, mixed = state[SADDLE], state[SKEW]
    ground = [state[CURVATURE], c2 * more - s2 * mixed, c2 * mixed + s2 * more]
    return np.array([pose.x_m, pose.y_m, pose.yaw_rad, *ground])


def pose_of(state: Vector) -> Motion:
    """Return the neighbour's pose in the follower's level frame."""
    return Motion(float(state[X]), float(state[Y]), float(state[YAW]))
