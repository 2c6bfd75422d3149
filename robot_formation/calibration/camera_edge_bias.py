"""How far the edges that the detector reports lie from where the marker's edges are in the picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.alignment.observation import MARGIN_PX, FaceBox, bounding_boxes
from robot_formation.alignment.precise.marker_edges import EdgeParameters
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH

Corners = NDArray[np.float64]
"""Columns and rows (4, 2) of a face's corners, px: left top, left bottom, right top, right bottom as seen from outside;
the left ones lie on the right if the face is turned away."""

_LEVEL_PX = 1.0
"""Slant of an edge up to which its row is one."""
_BANDS = EdgeParameters()
"""Where the values for other widths begin."""
_FEWEST = 3


@dataclass(frozen=True)
class EdgeBias:
    """Reported minus true position of an edge: number of views, mean and standard deviation of one view, px."""

    views: int
    mean_px: float
    scatter_px: float


def edge_biases(looks: Iterable[tuple[CameraSample, Mapping[Face, Corners]]]) -> dict[str, EdgeBias]:
    """Compare reported with true edges, by the names of `EdgeParameters`.

    Args:
        looks: each with the true corners of the marker's faces; without faces behind the camera.

    Returns:
        What was seen often enough to have a scatter.
    """
    found: dict[str, list[float]] = {}
    for sample, faces in looks:
        for name, error in _errors(bounding_boxes(sample.blocks), faces):
            found.setdefault(name, []).append(error)
    return {
        name: EdgeBias(len(errors), float(np.mean(errors)), float(np.std(errors, ddof=1)))
        for name, errors in sorted(found.items())
        if len(errors) >= _FEWEST
    }


def _errors(boxes: Mapping[Face, FaceBox], faces: Mapping[Face, Corners]) -> Iterator[tuple[str, float]]:
    target, front, rear = boxes.get(Face.TARGET), boxes.get(Face.FRONT), boxes.get(Face.REAR)
    if target is not None and _whole(faces.get(Face.TARGET)):
        left, right, top, bottom = _edges(faces[Face.TARGET])
        if front is None:
            yield "target_left_px", target.left - left
            if _turned_away(faces.get(Face.FRONT)):
                yield "target_right_px", target.right - right
        if top is not None and bottom is not None:
            yield "target_top_px", target.top - top
            yield "target_bottom_px", target.bottom - bottom
    if target is not None and front is not None and _whole(faces.get(Face.FRONT)):
        left, right, _, _ = _edges(faces[Face.FRONT])
        yield "front_left_px", front.left - left
        band = f"front_right_px[{_BANDS.front_band(front.width)}]"
        yield band if _BANDS.clear(target) else "rough_front_right_px", front.right - right
    if target is not None and rear is not None and _whole(faces.get(Face.REAR)):
        band = f"rear_left_px[{_BANDS.rear_band(rear.width)}]"
        yield band if _BANDS.clear(target) else "rough_rear_left_px", rear.left - _edges(faces[Face.REAR])[0]


def _edges(corners: Corners) -> tuple[float, float, float | None, float | None]:
    """Left and right column, and the upper and lower row where those edges are level."""
    columns, rows = corners.T
    tops, bottoms = rows[[0, 2]], rows[[1, 3]]
    level = max(np.ptp(tops), np.ptp(bottoms)) <= _LEVEL_PX
    top, bottom = (float(tops.mean()), float(bottoms.mean())) if level else (None, None)
    return float(columns[:2].mean()), float(columns[2:].mean()), top, bottom


def _turned_away(corners: Corners | None) -> bool:
    return corners is not None and bool(corners[:2, 0].mean() >= corners[2:, 0].mean())


def _whole(corners: Corners | None) -> bool:
    """Whether a face is turned towards the camera and wholly in the picture."""
    if corners is None or _turned_away(corners):
        return False
    return bool(np.all(corners > MARGIN_PX) and np.all(corners < np.array((WIDTH, HEIGHT)) - 1.0 - MARGIN_PX))
