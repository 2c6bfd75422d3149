"""Tags in place of colours: OpenCV's ArUco detector on the same pictures, its answers as the camera's blocks."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.vision.aruco_patterns import MODULES, QUIET_MODULES, dictionary
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_tracking import ALL_BLOCKS, ALL_SIGNATURES, Tracker
from robot_formation.vision.pixy2.boxes import Box
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import WIDTH, checked
from robot_formation.vision.tag_parameters import TagParameters

Points = NDArray[np.float32]

_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float32)
_SQUARE: Points = _CORNERS * np.float32(0.5 * MODULES)
_FACE: Points = _CORNERS * np.float32(0.5 * MODULES + QUIET_MODULES)


class TagDetector:
    """Finds the marker's tags and reports each face's bounding box as a block, tracked as blocks of a colour are.

    A box is that of the whole face, quiet zone included, without a bias of its own.

    Args:
        parameters: of the search.
        tracking: `block_filtering` and `max_tracking_velocity` are used, as for colours.

    Raises:
        TagError: if this OpenCV has no detector of tags.
    """

    def __init__(self, parameters: TagParameters | None = None, tracking: DetectorParameters | None = None) -> None:
        tracking = tracking or DetectorParameters()
        self._tracker = Tracker(tracking.block_filtering, tracking.max_tracking_velocity)
        self.configure(parameters or TagParameters(), tracking)

    def configure(self, parameters: TagParameters, tracking: DetectorParameters) -> None:
        """Change the parameters; tracked blocks are kept."""
        known = dictionary()
        self._enlargement = parameters.enlargement
        self._search = cv2.aruco.ArucoDetector(known, _opencv(parameters))
        self._tracker.configure(tracking.block_filtering, tracking.max_tracking_velocity)

    def reset(self) -> None:
        """Forget all tracked blocks; the next frame starts the clock and the indices anew."""
        self._tracker.reset()

    def faces(self, picture: ArrayLike) -> list[tuple[Face, Points]]:
        """Find the faces in a single picture, by number and from left to right.

        Args:
            picture: RGB, shape (208, 316, 3), uint8.

        Returns:
            Each face with the corners (4, 2) of its outline in pixels (column, row; integers are pixel centres), as
            seen upright: top left, top right, bottom right, bottom left.

        Raises:
            PictureError: if the picture has another shape or type.
        """
        grey = cv2.cvtColor(checked(picture), cv2.COLOR_RGB2GRAY)
        scale = self._enlargement
        if scale > 1:
            grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        found, numbers, _ = self._search.detectMarkers(grey)
        faces = []
        for corners, number in zip(found, [] if numbers is None else np.ravel(numbers).tolist(), strict=True):
            if number in set(Face):
                # The centre of an enlarged picture's first pixel is not that of the picture's.
                square = (corners.reshape(4, 2) + np.float32(0.5)) / np.float32(scale) - np.float32(0.5)
                faces.append((Face(number), _outline(square)))
        return sorted(faces, key=lambda entry: (entry[0], float(entry[1][:, 0].min())))

    def detect(self, picture: ArrayLike) -> list[Box]:
        """Boxes of the faces in a single picture, without tracking.

        Raises:
            PictureError: if the picture has another shape or type.
        """
        return [_box(face, corners) for face, corners in self.faces(picture)]

    def process(self, picture: ArrayLike, time_us: int) -> list[Block]:
        """See `BlockSensor`."""
        self._tracker.step(self.detect(picture), time_us)
        return self._tracker.answer(ALL_SIGNATURES, ALL_BLOCKS)


def _opencv(parameters: TagParameters) -> Any:
    """Translate into OpenCV's parameters. Refining its corners would make a box's edges worse, not better."""
    p, found = parameters, cv2.aruco.DetectorParameters()
    found.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    # OpenCV measures outlines by the picture's longer side, and both grow alike.
    found.minMarkerPerimeterRate = p.min_perimeter_px / WIDTH
    found.adaptiveThreshWinSizeMin = found.adaptiveThreshWinSizeMax = p.window_px
    found.adaptiveThreshConstant = p.threshold_constant
    found.polygonalApproxAccuracyRate = p.polygon_accuracy
    found.errorCorrectionRate = p.error_correction
    return found


def _outline(square: Points) -> Points:
    """Corners (4, 2) of a face from those of its dark square: the same plane, so the same projection."""
    projection = cv2.getPerspectiveTransform(_SQUARE, np.ascontiguousarray(square, np.float32))
    return np.asarray(cv2.perspectiveTransform(_FACE[None], projection)[0], np.float32)


def _box(face: Face, corners: Points) -> Box:
    """Bounding box whose reported centre and size are the nearest whole pixels, each by itself."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    (x, y), (width, height) = np.rint(0.5 * (low + high)).astype(int).tolist(), np.rint(high - low).astype(int).tolist()
    left, top = x - width // 2, y - height // 2
    return Box(int(face), left, left + width, top, top + height)
