"""What viewers draw."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from robot_formation.system.cdr import HEAD, add_numbers, add_text

_TRIANGLE_LIST, _ADD = 11, 0  # constants of visualization_msgs/Marker


def surface_marker(
    vertices: NDArray[np.float64], colours: NDArray[np.float64], triangles: NDArray[np.int64], frame: str
) -> bytes:
    """Make a Marker of a mesh, a TRIANGLE_LIST, serialised: its numbers go into it as arrays, at once.

    By way of rclpy's classes, with an object for each vertex, it takes 20 times as long.

    Args:
        vertices: (n, 3), metres.
        colours: (n, 3), 0..1.
        triangles: (m, 3) indices of vertices.
        frame: the frame of the vertices.
    """
    corners = triangles.ravel()
    opaque = np.column_stack([colours, np.ones(len(colours))])
    cdr = bytearray(HEAD)
    _add(cdr, "iI", 0, 0)  # stamp
    add_text(cdr, frame)
    add_text(cdr, "surface")
    _add(cdr, "iii", 0, _TRIANGLE_LIST, _ADD)
    _add(cdr, "ddddddd", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)  # pose
    _add(cdr, "ddd", 1.0, 1.0, 1.0)  # scale
    _add(cdr, "ffff", 0.0, 0.0, 0.0, 1.0)  # colour of what has none of its own
    _add(cdr, "iI", 0, 0)  # lifetime: for ever
    _add(cdr, "?", False)  # not locked to its frame
    _add(cdr, "I", len(corners))
    add_numbers(cdr, 8, vertices[corners].astype("<f8").tobytes())
    _add(cdr, "I", len(corners))
    add_numbers(cdr, 4, opaque[corners].astype("<f4").tobytes())
    add_text(cdr, "")  # texture: resource, then a picture with stamp, frame, format and data, then its coordinates
    _add(cdr, "iI", 0, 0)
    add_text(cdr, "")
    add_text(cdr, "")
    _add(cdr, "II", 0, 0)
    add_text(cdr, "")  # text
    add_text(cdr, "")  # mesh: resource, then a file with name and data, then whether its materials are used
    add_text(cdr, "")
    _add(cdr, "I", 0)
    _add(cdr, "?", False)
    return bytes(cdr)


def _add(cdr: bytearray, kinds: str, *values: float) -> None:
    """Add numbers of one size."""
    add_numbers(cdr, struct.calcsize(kinds[0]), struct.pack(f"<{kinds}", *values))
