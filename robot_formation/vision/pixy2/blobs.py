"""From row segments to blobs: connecting what overlaps the row above (Pixy2 behaviour).

The loops go segment by segment. Where there is a C compiler they are compiled, with the types of blobs.pxd.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_formation.vision.pixy2.parameters import SIGNATURES
from robot_formation.vision.pixy2.picture import HEIGHT
from robot_formation.vision.pixy2.segments import Segments

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
    # Segments by signature, those of one signature in the order of the scan; the first segment of each segment's blob;
    # and of blobs, by their first segment: area, sides and the start of the last segment.
    arrays = np.empty((9, count), np.intp)
    row, start, end, root, area, left, right, bottom, place = [array.data for array in arrays]
    stops, noticed = np.zeros(SIGNATURES + 1, np.intp).data, np.empty(_NEVER + 1, np.intp).data
    _sort(segments.signature.data, segments.row.data, segments.start.data, segments.end.data, row, start, end, stops)
    found: dict[int, list[Blob]] = {}
    for number in range(1, SIGNATURES + 1):
        first, stop = stops[number - 1], stops[number]
        if first == stop:
            continue
        _join(first, stop, row, start, end, root)
        _measure(first, stop, row, start, end, root, area, left, right, bottom, place)
        _notice(first, stop, row, noticed)
        ranked = []
        for segment in range(first, stop):
            if root[segment] == segment:
                last = bottom[segment]
                seen = noticed[last + 2]
                if seen == _NEVER or last - row[segment] > 1:
                    rank = (area[segment] * (_NEVER + 1) + seen) * _COLUMNS + place[segment]
                    ranked.append((-rank, segment))
        if ranked:
            ranked.sort()
            found[number] = [
                Blob(number, left[segment], right[segment], row[segment], bottom[segment], area[segment])
                for _, segment in ranked
            ]
    return found


def _sort(
    signature: memoryview[int],
    any_row: memoryview[int],
    any_start: memoryview[int],
    any_end: memoryview[int],
    row: memoryview[int],
    start: memoryview[int],
    end: memoryview[int],
    stops: memoryview[int],
) -> None:
    """Sort segments by signature, those of one signature in their order.

    Args:
        signature: of each segment.
        any_row: row of each segment.
        any_start: first cell of each segment.
        any_end: last cell of each segment.
        row: takes the rows, by signature.
        start: takes the first cells, by signature.
        end: takes the last cells, by signature.
        stops: takes the number of segments up to each signature's last one, by signature number; zeros before.
    """
    for segment in range(len(signature)):
        stops[signature[segment]] += 1
    for number in range(1, len(stops)):
        stops[number] += stops[number - 1]
    # From now on each is the place before which the next one of the signature, from the last one back, belongs.
    for segment in range(len(signature) - 1, -1, -1):
        place = stops[signature[segment]] - 1
        stops[signature[segment]] = place
        row[place] = any_row[segment]
        start[place] = any_start[segment]
        end[place] = any_end[segment]
    # Each is now where its signature begins, which is where the one before it ends.
    for number in range(1, len(stops)):
        stops[number - 1] = stops[number]
    stops[len(stops) - 1] = len(signature)


def _join(
    first: int,
    stop: int,
    row: memoryview[int],
    start: memoryview[int],
    end: memoryview[int],
    root: memoryview[int],
) -> None:
    """Find an earlier segment of each segment's blob, from which `_find` goes on to the blob's first one.

    Args:
        first: the first segment of a signature.
        stop: the first one of the next signature.
        row: row of each segment, ascending within a signature.
        start: first cell of each segment, ascending within a row.
        end: last cell of each segment, ascending within a row.
        root: takes the result.
    """
    # Where the row above begins and ends, and its first segment that ends no earlier than the current one starts.
    above = first
    row_first = first
    near = first
    current = -2
    for segment in range(first, stop):
        if row[segment] != current:
            above = row_first if row[segment] == current + 1 else segment
            row_first = segment
            near = above
            current = row[segment]
        while near < row_first and end[near] < start[segment]:
            near += 1
        root[segment] = segment
        # The first segment of its blob so far.
        one = segment
        other = near
        while other < row_first and start[other] <= end[segment]:
            two = _find(root, other)
            if one < two:
                root[two] = one
            else:
                root[one] = two
                one = two
            other += 1
        if other == near and above < near < row_first:
            # It lies in a gap of the row above, within a blob if both neighbours belong to the same one.
            one = _find(root, near - 1)
            if one == _find(root, near):
                root[segment] = one


def _find(root: memoryview[int], segment: int) -> int:
    """The first segment of a segment's blob."""
    while root[segment] != segment:
        # Half of the way is left for the next search.
        root[segment] = root[root[segment]]
        segment = root[segment]
    return segment


def _measure(
    first: int,
    stop: int,
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
    for segment in range(first, stop):
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


def _notice(first: int, stop: int, row: memoryview[int], noticed: memoryview[int]) -> None:
    """Find the row in which the camera notices that a blob has ended: the first with segments from a given one on."""
    after = _NEVER
    noticed[_NEVER] = _NEVER
    for segment in range(stop - 1, first - 1, -1):
        current = row[segment]
        # No segments lie in the rows between.
        for later in range(current + 1, after):
            noticed[later] = after
        noticed[current] = current
        after = current
