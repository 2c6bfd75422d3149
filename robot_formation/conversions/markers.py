"""What viewers draw."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from robot_formation.conversions.basics import stamped


def surface_marker(
    vertices: NDArray[np.float64], colours: NDArray[np.float64], triangles: NDArray[np.int64], frame: str
) -> Marker:
    """Make a TRIANGLE_LIST of a mesh.

    Args:
        vertices: (n, 3), metres.
        colours: (n, 3), 0..1.
        triangles: (m, 3) indices of vertices.
        frame: the frame of the vertices.
    """
    marker = stamped(Marker, 0, frame, ns="surface", id=0, type=Marker.TRIANGLE_LIST, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    # Triangles share their corners: each is made once, not six times.
    points = [Point(x=x, y=y, z=z) for x, y, z in vertices.tolist()]
    shades = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in colours.tolist()]
    corners = triangles.ravel().tolist()
    marker.points = [points[corner] for corner in corners]
    marker.colors = [shades[corner] for corner in corners]
    marker.color.a = 1.0
    return marker
