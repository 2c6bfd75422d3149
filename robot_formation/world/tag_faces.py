"""Tags on the marker's faces as plane rectangles, so that they are drawn as any other face is."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robot_formation.vision.aruco_patterns import MODULES, QUIET_MODULES, pattern
from robot_formation.vision.marker import Face

Array = NDArray[np.float64]
FACES: dict[Face, tuple[float, float, float]] = {
    Face.TARGET: (0.0, -1.0, 0.0),
    Face.FRONT: (1.0, 0.0, 0.0),
    Face.REAR: (-1.0, 0.0, 0.0),
}
"""Faces that carry a tag, with their outward normals in base_link."""


def tag_rectangles(face: Face, edge_m: float, middle_z_m: float) -> Iterator[tuple[Array, Array, bool]]:
    """Yield what lies on a light face, in drawing order: corners (4, 3) in base_link, normal (3,), whether it is light.

    The dark square comes first, then its light modules, those that are neighbours in a row as one rectangle.

    Args:
        face: the marker's face.
        edge_m: the cube's edge, which is the tag's with its quiet zone.
        middle_z_m: height of the cube's middle.
    """
    normal = np.array(FACES[face])
    up = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, normal)  # of who looks at the face
    module = edge_m / (MODULES + 2 * QUIET_MODULES)
    origin = 0.5 * edge_m * normal + middle_z_m * up + 0.5 * MODULES * module * (up - right)

    def rectangle(row: int, column: int, rows: int, columns: int) -> Array:
        corner = origin + module * (column * right - row * up)
        across, down = module * columns * right, -module * rows * up
        return np.stack([corner, corner + across, corner + across + down, corner + down])

    yield rectangle(0, 0, MODULES, MODULES), normal, False
    for row, lights in enumerate(pattern(face).tolist()):
        for light, group in itertools.groupby(range(MODULES), key=lights.__getitem__):
            columns = list(group)
            if light:
                yield rectangle(row, columns[0], 1, len(columns)), normal, True
