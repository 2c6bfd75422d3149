"""From row segments to blobs: connecting what overlaps the row above (Pixy2 behaviour).

The loops go segment by segment. Where there is a C compiler they are compiled, with the types of blobs.pxd.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_formation.vision.pixy2.parameters import SIGNATURES
from robot_formation.vision.pixy2.picture import HEIGHT
from robot_formation.vision.pixy2.scanner import Segments

_COLUMNS = 256
"""More than a picture has columns."""
_NEVER = HEIGHT + 2
"""Stands for a row after the last one."""


class Blob(NamedTuple):
    """A connected component in cells (columns) and rows, all sides inclusive."""

    signature: int
    left: int
    right: int
    top: int
    bottom: int
    area: int


def connect(segments: Segments) -> dict[int, list[Blob]]:
    """Connect row segments to the blobs of each signature, largest area first.

    A segment joins what it overlaps or touches by one column, diagonals included, on the row above; a blob spans there
    the gaps between its own segments too. Blobs that ended with fewer than three rows are left out.

    The camera keeps the blobs that can still grow in a list and looks for ended ones as it goes along it. Blobs of
    equal area come in the reverse order of their ends, those that ended together from right to left. (The camera may
    notice an end a row late beyond its row's last segment; that is not followed, and exchanges equal areas at most.)
    """
    count = len(segments.row)
    if not count:
        return {}
    signature, row, start, end = [array.data for array in segments]
    # Segments by signature, of one signature in the order of the scan; the first segment of each segment's blob; and of
    # blobs, by their first segment: area, sides and the start of the last segment.
    order, root, area, left, right, bottom, place = [array.data for array in np.empty((7, count), np.intp)]
    stops, noticed = np.zeros(SIGNATURES + 1, np.intp).data, np.empty(_NEVER + 1, np.intp).data
    _sort(signature, order, stops)
    found: dict[int, list[Blob]] = {}
    for number in range(1, SIGNATURES + 1):
        mine = order[stops[number - 1] : stops[number]]
        if not len(mine):
            continue
        _join(mine, row, start, end, root)
        _measure(mine, row, start, end, root, area, left, right, bottom, place)
        _notice(mine, row, noticed)
        ranked = []
        for position in range(len(mine)):
            segment = mine[position]
            if root[segment] == segment:
                top, last = row[segment], bottom[segment]
                seen = noticed[last + 2]
                if seen == _NEVER or last - top > 1:
                    rank = (area[segment] * (_NEVER + 1) + seen) * _COLUMNS + place[segment]
                    ranked.append((-rank, segment))
        if ranked:
            ranked.sort()
            found[number] = [
                Blob(number, left[segment], right[segment], row[segment], bottom[segment], area[segment])
                for _, segment in ranked
            ]
    return found


def _sort(signature: memoryview[int], order: memoryview[int], stops: memoryview[int]) -> None:
    """Sort segments by signature.

    Args:
        signature: of each segment.
        order: takes the segments by signature, those of one signature in their order.
        stops: takes the place in `order` after each signature's last segment, by signature number; zeros before.
    """
    count = len(signature)
    for segment in range(count):
        stops[signature[segment]] += 1
    for number in range(1, len(stops)):
        stops[number] += stops[number - 1]
    for segment in range(count - 1, -1, -1):
        stops[signature[segment]] -= 1
        order[stops[signature[segment]]] = segment
    # Each is now where its signature begins, which is where the one before it ends.
    for number in range(len(stops) - 1):
        stops[number] = stops[number + 1]
    stops[len(stops) - 1] = count


def _join(
    mine: memoryview[int], row: memoryview[int], start: memoryview[int], end: memoryview[int], root: memoryview[int]
) -> None:
    """Find the first segment of each segment's blob, or an earlier one of its blob from which `_find` goes on to that.

    Args:
        mine: the segments of one signature, by row and column.
        row: row of each segment.
        start: first cell of each segment.
        end: last cell of each segment.
        root: takes the result, by segment.
    """
    # Of the row above, places in `mine`: its first segment, the first that ends no earlier than the current segment
    # starts, and the first of the next row.
    first = 0
    near = 0
    stop = 0
    # Where the current row begins.
    begin = 0
    current = -2
    for number in range(len(mine)):
        segment = mine[number]
        if row[segment] != current:
            first = begin if row[segment] == current + 1 else number
            near, stop, begin, current = first, number, number, row[segment]
        while near < stop and end[mine[near]] < start[segment]:
            near += 1
        root[segment] = segment
        other = near
        while other < stop and start[mine[other]] <= end[segment]:
            one = _find(root, segment)
            two = _find(root, mine[other])
            if one < two:
                root[two] = one
            else:
                root[one] = two
            other += 1
        if other == near and first < near < stop:
            # It lies in a gap of the row above, within a blob if both neighbours belong to the same one.
            one = _find(root, mine[near - 1])
            if one == _find(root, mine[near]):
                root[segment] = one


def _find(root: memoryview[int], segment: int) -> int:
    """The first segment of a segment's blob."""
    while root[segment] != segment:
        # Half of the way is left for the next search.
        root[segment] = root[root[segment]]
        segment = root[segment]
    return segment


def _measure(
    mine: memoryview[int],
    row: memoryview[int],
    start: memoryview[int],
    end: memoryview[int],
    root: memoryview[int],
    area: memoryview[int],
    left: memoryview[int],
    right: memoryview[int],
    bottom: memoryview[int],
    place: memoryview[int],
) -> None:
    """Measure the blobs of one signature; the results belong to each blob's first segment."""
    for number in range(len(mine)):
        segment = mine[number]
        # Earlier segments have their blob's first one already, and no segment's is later than itself.
        blob = root[root[segment]]
        root[segment] = blob
        if blob == segment:
            area[blob] = 0
            left[blob] = start[segment]
            right[blob] = end[segment]
        area[blob] += end[segment] - start[segment] + 1
        left[blob] = min(left[blob], start[segment])
        right[blob] = max(right[blob], end[segment])
        # Segments come from top to bottom: the last one counts.
        bottom[blob] = row[segment]
        place[blob] = start[segment]


def _notice(mine: memoryview[int], row: memoryview[int], noticed: memoryview[int]) -> None:
    """Find the row in which the camera notices that a blob has ended: the first with segments from a given one on."""
    row_stop = _NEVER
    noticed[_NEVER] = _NEVER
    for number in range(len(mine) - 1, -1, -1):
        begin = row[mine[number]]
        # No segments lie in the rows between.
        for later in range(begin + 1, row_stop):
            noticed[later] = noticed[row_stop]
        noticed[begin] = begin
        row_stop = begin
