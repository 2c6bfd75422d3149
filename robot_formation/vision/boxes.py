"""Boxes: filters, merging of boxes that face each other, removal of nested ones (Pixy2 behaviour)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from robot_formation.vision.blobs import Blob

CODE_AREA = 10
"""Smallest blob of a colour code signature, cells."""


@dataclass(slots=True)
class Box:
    """A box in frame pixels, all sides inclusive.

    Attributes:
        signature: 1..7, or a colour code (its digits read as octal, at least 8).
        left: pixels, even.
        right: pixels, even.
        top: pixels.
        bottom: pixels.
        angle: direction of a colour code, degrees, x to the right and y up; 0 for a plain box.
    """

    signature: int
    left: int
    right: int
    top: int
    bottom: int
    angle: int = 0

    @property
    def width(self) -> int:
        """Width as the camera reports it: right - left, pixels."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """Height as the camera reports it: bottom - top, one less than the rows covered."""
        return self.bottom - self.top

    @property
    def x(self) -> int:
        """Column of the centre, pixels."""
        return (self.left + self.right) >> 1

    @property
    def y(self) -> int:
        """Row of the centre, pixels."""
        return (self.top + self.bottom) >> 1

    def contains(self, other: Box) -> bool:
        """Whether the other box lies within this one, common sides allowed."""
        return (
            self.left <= other.left
            and other.right <= self.right
            and self.top <= other.top
            and other.bottom <= self.bottom
        )


def filtered(signature: int, blobs: Iterable[Blob], min_area: int, room: int) -> list[Box]:
    """Boxes of the blobs of at least min_area cells and three rows, at most `room` of them."""
    boxes: list[Box] = []
    for blob in blobs:
        if len(boxes) >= room:
            break
        if blob.area >= min_area and blob.row - blob.top > 1:
            boxes.append(Box(signature, 2 * blob.left, 2 * blob.right, blob.top, blob.row))
    return boxes


def merged(boxes: list[Box], distance: int) -> list[Box]:
    """Merge boxes of one signature that face each other with a gap of at most `distance` pixels.

    Every box in turn takes in those after it; passes over all are repeated until one changes nothing.
    """
    changed = True
    while changed:
        changed = False
        alive: list[Box] = []
        while boxes:
            box, *others = boxes
            boxes = []
            for other in others:
                if _merge(box, other, distance):
                    changed = True
                else:
                    boxes.append(other)
            alive.append(box)
        boxes = alive
    return boxes


def _merge(box: Box, other: Box, distance: int) -> bool:
    """Let a box take in another one if they face each other on either axis."""
    rows_overlap = box.top <= other.bottom and other.top <= box.bottom
    columns_overlap = box.left <= other.right and other.left <= box.right
    if rows_overlap:
        span = _joined(box.left, box.right, other.left, other.right, distance)
        if span is not None:
            box.left, box.right = span
            box.top, box.bottom = min(box.top, other.top), max(box.bottom, other.bottom)
            return True
    if columns_overlap:
        span = _joined(box.top, box.bottom, other.top, other.bottom, distance)
        if span is not None:
            box.top, box.bottom = span
            box.left, box.right = min(box.left, other.left), max(box.right, other.right)
            return True
    return False


def _joined(low: int, high: int, other_low: int, other_high: int, distance: int) -> tuple[int, int] | None:
    """The joined extent on an axis, or None if the other interval is too far away or strictly inside."""
    if other_low <= low and (low <= other_high <= high or 0 <= low - other_high <= distance):
        return other_low, high
    if low <= other_low and (other_low <= high <= other_high or 0 <= other_low - high <= distance):
        return low, other_high
    return None


def without_nested(boxes: list[Box]) -> list[Box]:
    """Drop boxes that lie within another one, whatever their signatures."""
    dead: set[int] = set()
    for i, box in enumerate(boxes):
        if i in dead:
            continue
        for j in range(i + 1, len(boxes)):
            if j in dead:
                continue
            if box.contains(boxes[j]):
                dead.add(j)
            elif boxes[j].contains(box):
                # The camera goes on comparing later boxes with the one that it has just dropped.
                dead.add(i)
    return [box for i, box in enumerate(boxes) if i not in dead]
