"""The marker's alternative to colours: which ArUco tag each face carries, for those who draw it and who look for it."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.errors import FormationError
from robot_formation.vision.marker import Face

MODULES = 7
"""Modules along a tag's dark square: five of data between two of border."""
QUIET_MODULES = 1
"""Modules of light margin that a face keeps around the dark square, so that a tag's border is seen before any wall."""


class TagError(FormationError):
    """Tags can't be drawn or looked for."""


def dictionary() -> Any:
    """Return OpenCV's dictionary of the faces' tags: DICT_5X5_50.

    Raises:
        TagError: if this OpenCV has no detector of such tags.
    """
    aruco = getattr(cv2, "aruco", None)
    if not hasattr(aruco, "ArucoDetector"):
        raise TagError(
            f"tags need OpenCV 4.7 or newer, this is {cv2.__version__}: "
            "pip install opencv-python-headless, or take the marker 'colours'"
        )
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)


def pattern(face: Face) -> NDArray[np.bool_]:
    """Return a face's tag as it is seen, (7, 7) from its top left, true where light; the quiet zone is not part of it.

    Raises:
        TagError: if this OpenCV has no such tags.
    """
    tags = dictionary()
    return np.asarray(cv2.aruco.generateImageMarker(tags, int(face), MODULES)) > 127
