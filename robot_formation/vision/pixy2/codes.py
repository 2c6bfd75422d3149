"""Colour codes: two to five neighbouring boxes of code signatures read as one number (Pixy2 behaviour)."""

from __future__ import annotations

import itertools
import math

from robot_formation.vision.pixy2.boxes import Box

REACH = 8
"""Largest gap between neighbours in a code, pixels."""
_SIMILAR = 9
"""Largest ratio of areas within a code."""
_DIGITS = (2, 5)


def with_codes(plain: list[Box], parts: list[Box], *, keep_single: bool) -> list[Box]:
    """Replace the parts of colour codes by the codes.

    Args:
        plain: boxes of signatures that make no codes; they come first in the answer.
        parts: boxes of code signatures.
        keep_single: whether parts that belong to no code are kept ("mixed") or dropped.
    """
    boxes = list(plain)
    codes: list[Box] = []
    for cluster in _clusters(parts):
        digits = _in_order(_similar(cluster))[: _DIGITS[1]]
        if len(digits) >= _DIGITS[0]:
            codes.append(_code(digits))
        elif keep_single:
            boxes.extend(cluster)
    return boxes + codes


def _clusters(parts: list[Box]) -> list[list[Box]]:
    """Groups of boxes connected by neighbours of different signatures."""
    clusters: list[list[Box]] = []
    left = list(parts)
    while left:
        cluster = [left.pop(0)]
        for box in cluster:
            near = [other for other in left if _neighbours(box, other)]
            left = [other for other in left if not _neighbours(box, other)]
            # The loop goes on over what is appended: neighbours of neighbours belong to the code as well.
            cluster.extend(near)
        clusters.append(cluster)
    return clusters


def _neighbours(box: Box, other: Box) -> bool:
    if box.signature == other.signature:
        return False
    gap_x = max(box.left, other.left) - min(box.right, other.right)
    gap_y = max(box.top, other.top) - min(box.bottom, other.bottom)
    return (gap_y <= 0 and gap_x <= REACH) or (gap_x <= 0 and gap_y <= REACH)


def _similar(cluster: list[Box]) -> list[Box]:
    """The boxes whose areas are within a factor of the most typical one's."""

    def alike(box: Box) -> list[Box]:
        area = box.width * box.height
        return [o for o in cluster if area <= _SIMILAR * o.width * o.height and o.width * o.height <= _SIMILAR * area]

    return max((alike(box) for box in cluster), key=len)


def _in_order(cluster: list[Box]) -> list[Box]:
    """Sort along the longer direction and keep one of adjacent boxes with equal signatures."""
    width = max(box.right for box in cluster) - min(box.left for box in cluster)
    height = max(box.bottom for box in cluster) - min(box.top for box in cluster)
    ordered = sorted(cluster, key=lambda box: box.x if width >= height else box.y)
    return ordered[:1] + [b for a, b in itertools.pairwise(ordered) if a.signature != b.signature]


def _code(digits: list[Box]) -> Box:
    """The code of boxes in order, read in the direction that gives the smaller number."""
    forward = _number(digits)
    backward = _number(digits[::-1])
    first, last = (digits[0], digits[-1]) if forward <= backward else (digits[-1], digits[0])
    angle = int(math.degrees(math.atan2(first.y - last.y, last.x - first.x)))
    return Box(
        min(forward, backward),
        min(box.left for box in digits),
        max(box.right for box in digits),
        min(box.top for box in digits),
        max(box.bottom for box in digits),
        angle,
    )


def _number(digits: list[Box]) -> int:
    """Signatures as octal digits."""
    number = 0
    for box in digits:
        number = 8 * number + box.signature
    return number
