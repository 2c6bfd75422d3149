"""Boxes: filters, merging of boxes that face each other, removal of nested ones (Pixy2 behaviour)."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Iterable
from dataclasses import dataclass

from robot_formation.vision.pixy2.blobs import Blob

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
    changed = _some_near(boxes, distance)
    while changed:
        changed = False
        alive: list[Box] = []
        while boxes:
            box, *others = boxes
            boxes = []
            left, right, top, bottom = _reach(box, distance)
            for other in others:
                # Most pairs are far apart: that is told first, and fast.
                if other.left > right or other.right < left or other.top > bottom or other.bottom < top:
                    boxes.append(other)
                elif _merge(box, other, distance):
                    changed = True
                    left, right, top, bottom = _reach(box, distance)
                else:
                    boxes.append(other)
            alive.append(box)
        boxes = alive
    return boxes


def _some_near(boxes: list[Box], distance: int) -> bool:
    """Whether any two boxes are near enough to be looked at more closely; most boxes of a picture of many are not."""
    from_left = sorted(boxes, key=operator.attrgetter("left"))
    for place, box in enumerate(from_left, 1):
        _, right, top, bottom = _reach(box, distance)
        for other in itertools.islice(from_left, place, None):
            if other.left > right:
                break
            if other.top <= bottom and other.bottom >= top:
                return True
    return False


def _reach(box: Box, distance: int) -> tuple[int, int, int, int]:
    """Left, right, top and bottom of what is near enough to a box to be merged with it."""
    return box.left - distance, box.right + distance, box.top - distance, box.bottom + distance


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
    """Drop boxes that lie within another one, common sides allowed, whatever their signatures."""
    dead: set[int] = set()
    turn = -1
    for i, j in _nested_pairs(boxes):
        if j in dead or (i in dead and i != turn):
            continue
        # The camera goes on comparing later boxes with the one that it has just dropped, until that one's turn ends.
        turn = i
        dead.add(j if _contains(boxes[i], boxes[j]) else i)
    return [box for i, box in enumerate(boxes) if i not in dead]


def _nested_pairs(boxes: list[Box]) -> list[tuple[int, int]]:
    """Pairs i < j of boxes one of which lies within the other, in ascending order."""
    pairs = []
    from_left = sorted((box.left, i, box) for i, box in enumerate(boxes))
    for place, (_, i, box) in enumerate(from_left, 1):
        right, top, bottom = box.right, box.top, box.bottom
        for left, j, other in itertools.islice(from_left, place, None):
            if left > right:
                break
            if other.top > bottom or other.bottom < top:
                continue
            if _contains(box, other) or _contains(other, box):
                pairs.append((i, j) if i < j else (j, i))
    return sorted(pairs)


def _contains(box: Box, other: Box) -> bool:
    return box.left <= other.left and other.right <= box.right and box.top <= other.top and other.bottom <= box.bottom
