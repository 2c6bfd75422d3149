"""Blocks of a neighbour at a known pose: what an ideal camera with the detector's known biases would report."""

import numpy as np
import numpy.typing as npt

from robot_formation.alignment.precise.marker_edges import EdgeParameters
from robot_formation.alignment.precise.marker_projection import GeometryParameters, MarkerModel, Matrix, Vector
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

Array = npt.NDArray[np.float64]

MODEL = MarkerModel(GeometryParameters())
EDGES = EdgeParameters()
BOWL_CURVATURE_PER_M = 0.2
_LEAST_WIDTH_PX = {Face.TARGET: 9.0, Face.FRONT: 9.0, Face.REAR: 15.0}
_CORNERS = {Face.TARGET: [0, 1, 2, 3], Face.FRONT: [2, 3, 4, 5], Face.REAR: [6, 7, 0, 1]}


def state_of(
    x_m: float = 0.0,
    y_m: float = FORMATION_DISTANCE_M,
    yaw_rad: float = 0.0,
    curvature_per_m: float = BOWL_CURVATURE_PER_M,
) -> Vector:
    """The neighbour in the follower's frame."""
    return np.array([x_m, y_m, yaw_rad, curvature_per_m, 0.0, 0.0])


def blocks_of(state: Vector) -> list[Block]:
    """Blocks of the faces that are wide enough to be reported, edges biased as the detector does."""
    pixels, widths = MODEL.pixels(state[None])[0], MODEL.widths(state)
    seen = [face for face, least in _LEAST_WIDTH_PX.items() if widths[face] > least]
    return [_block(face, pixels[_CORNERS[face]], seen, index) for index, face in enumerate(sorted(seen))]


def _block(face: Face, corners: Matrix, seen: list[Face], index: int) -> Block:
    e = EDGES
    biases = {
        Face.TARGET: (e.target_left_px + (0.5 if Face.FRONT in seen else 0.0), e.target_right_px),
        Face.FRONT: (e.front_left_px, e.front_right_px[-1]),
        Face.REAR: (e.rear_left_px[-1], 0.0),
    }[face]
    left, right = corners[:, 0].min() + biases[0], corners[:, 0].max() + biases[1]
    top, bottom = corners[:, 1].min() + e.target_top_px, corners[:, 1].max() + e.target_bottom_px
    return Block(face, 0.5 * (left + right), 0.5 * (top + bottom), right - left, bottom - top, index=index)
