"""What a frame shows of the marker: one bounding box for each of its faces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

MARGIN_PX = 5.0
"""An edge nearer to the picture's border may be the border's, not the marker's. Chosen: more than the detector's errors
at an edge, which are up to 4 px (bench/marker_edges.py)."""


@dataclass(frozen=True)
class FaceBox:
    """Bounding box of the blocks of one signature: inclusive edges in pixels."""

    left: float
    right: float
    top: float
    bottom: float

    @property
    def x(self) -> float:
        """Column of the centre, px."""
        return (self.left + self.right) / 2.0

    @property
    def width(self) -> float:
        """Width as the camera reports it, px."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height as the camera reports it, px."""
        return self.bottom - self.top

    @property
    def side(self) -> float:
        """The longer side, px: a face seen obliquely is narrower, not lower."""
        return max(self.width, self.height)


def bounding_boxes(blocks: Iterable[Block]) -> dict[Face, FaceBox]:
    """Merge the blocks of each marker signature into their bounding box (a face split by flicker counts once)."""
    boxes: dict[Face, FaceBox] = {}
    for block in blocks:
        if block.signature not in set(Face):
            continue
        face = Face(block.signature)
        half_width, half_height = block.width / 2.0, block.height / 2.0
        box = FaceBox(block.x - half_width, block.x + half_width, block.y - half_height, block.y + half_height)
        known = boxes.get(face)
        if known is not None:
            box = FaceBox(
                min(known.left, box.left),
                max(known.right, box.right),
                min(known.top, box.top),
                max(known.bottom, box.bottom),
            )
        boxes[face] = box
    return boxes
