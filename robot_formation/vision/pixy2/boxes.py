"""Boxes: filters, merging of boxes that face each other, removal of nested ones (Pixy2 behaviour).

The loops go over pairs of boxes. Where there is a C compiler they are compiled, with the types of boxes.pxd.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from robot_formation.vision.pixy2.blobs import Blob

CODE_AREA = 10
"""Smallest blob of a colour code signature, cells."""


@dataclass
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


def filtered(blobs: Iterable[Blob], min_area: int, room: int) -> list[Box]:
    """Boxes of the blobs of at least min_area cells and three rows, at most `room` of them."""
    boxes = [
        Box(signature, 2 * left, 2 * right, top, bottom)
        for signature, left, right, top, bottom, area in blobs
        if area >= min_area and bottom - top > 1
    ]
    return boxes[:room]


def merged(boxes: list[Box], distance: int) -> list[Box]:
    """Merge boxes of one signature that face each other with a gap of at most `distance` pixels.

    Every box in turn takes in those after it; passes over all are repeated until one changes nothing.
    """
    changed = True
    while changed:
        changed = False
        alive = [True] * len(boxes)
        for i in range(len(boxes)):
            if not alive[i]:
                continue
            box = boxes[i]
            for j in range(i + 1, len(boxes)):
                other = boxes[j]
                # Most pairs are far apart: that is told first, and fast.
                if other.left - box.right > distance or other.top - box.bottom > distance:
                    continue
                if alive[j] and _merge(box, other, distance):
                    alive[j] = False
                    changed = True
        if changed:
            boxes = [box for box, left in zip(boxes, alive, strict=True) if left]
    return boxes


def _merge(box: Box, other: Box, distance: int) -> bool:
    """Let a box take in another one if they face each other on either axis."""
    side = 0
    if box.top <= other.bottom and other.top <= box.bottom:
        side = _facing(box.left, box.right, other.left, other.right, distance)
        if side < 0:
            box.left = other.left
        elif side > 0:
            box.right = other.right
        if side:
            box.top = min(box.top, other.top)
            box.bottom = max(box.bottom, other.bottom)
            return True
    if box.left <= other.right and other.left <= box.right:
        side = _facing(box.top, box.bottom, other.top, other.bottom, distance)
        if side < 0:
            box.top = other.top
        elif side > 0:
            box.bottom = other.bottom
        if side:
            box.left = min(box.left, other.left)
            box.right = max(box.right, other.right)
            return True
    return False


def _facing(low: int, high: int, other_low: int, other_high: int, distance: int) -> int:
    """Which end of an interval that of another one replaces: the low one (-1), the high one (1) or none (0).

    None if the other interval is too far away or strictly inside.
    """
    if other_low <= low and (low <= other_high <= high or 0 <= low - other_high <= distance):
        return -1
    if low <= other_low and (other_low <= high <= other_high or 0 <= other_low - high <= distance):
        return 1
    return 0


def without_nested(boxes: list[Box]) -> list[Box]:
    """Drop boxes that lie within another one, common sides allowed, whatever their signatures."""
    alive = [True] * len(boxes)
    for i in range(len(boxes)):
        if not alive[i]:
            continue
        box = boxes[i]
        # The camera goes on comparing later boxes with one that it has just dropped, until that one's turn ends.
        for j in range(i + 1, len(boxes)):
            other = boxes[j]
            if not alive[j] or other.left > box.right or other.right < box.left:
                continue
            if _contains(box, other):
                alive[j] = False
            elif _contains(other, box):
                alive[i] = False
    return [box for box, left in zip(boxes, alive, strict=True) if left]


def _contains(box: Box, other: Box) -> bool:
    return box.left <= other.left and other.right <= box.right and box.top <= other.top and other.bottom <= box.bottom
