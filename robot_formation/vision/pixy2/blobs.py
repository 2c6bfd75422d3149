"""From row segments to blobs: connecting what overlaps the row above (Pixy2 behaviour)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_formation.vision.pixy2.picture import HEIGHT
from robot_formation.vision.pixy2.scanner import Segments
from robot_formation.vision.pixy2.teaching import IntArray

_ROW = 256
"""More than a row has cells, so that places in different rows never overlap."""
_SIGNATURE = 256 * _ROW
"""More than a picture has rows, so that the rows of different signatures are never neighbours."""
_DOUBLINGS = (HEIGHT - 1).bit_length()
"""Steps of twice the reach that lead from any row to the first one."""


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
    if not len(segments.row):
        return {}
    order = segments.signature.astype(np.uint8).argsort(kind="stable")
    signature, row, start, end = (array.take(order) for array in segments)
    rows = signature * _SIGNATURE + row * _ROW
    root = _roots(rows, rows + start, rows + end)
    area = np.zeros_like(root)
    np.add.at(area, root, end - start + 1)
    left, right, bottom, place = start.copy(), end.copy(), row.copy(), start.copy()
    np.minimum.at(left, root, start)
    np.maximum.at(right, root, end)
    # Segments come from top to bottom: the last assignment counts.
    bottom[root] = row
    place[root] = start
    blobs = (root == np.arange(len(root))).nonzero()[0]
    signature, left, right, top, bottom, area, place = (
        array.take(blobs) for array in (signature, left, right, row, bottom, area, place)
    )
    noticed = _ends(rows, signature, bottom)
    kept = ((noticed == len(rows)) | (bottom - top > 1)).nonzero()[0]
    kept = kept.take(np.lexsort((-place.take(kept), -noticed.take(kept), -area.take(kept), signature.take(kept))))
    columns = (array.take(kept).tolist() for array in (signature, left, right, top, bottom, area))
    found: dict[int, list[Blob]] = {}
    for blob in map(Blob, *columns):
        found.setdefault(blob.signature, []).append(blob)
    return found


def _ends(rows: IntArray, signature: IntArray, bottom: IntArray) -> IntArray:
    """The segment at which each blob's end is noticed: in the next row but one or later; all segments if in none."""
    noticed = rows.searchsorted(signature * _SIGNATURE + (bottom + 2) * _ROW)
    noticed[rows.take(noticed, mode="clip") // _SIGNATURE != signature] = len(rows)
    return noticed


def _roots(rows: IntArray, left: IntArray, right: IntArray) -> IntArray:
    """The first segment of each segment's blob, shape (n,).

    Args:
        rows: place of each segment's row, ascending.
        left: place of each segment's first cell, ascending.
        right: place of each segment's last cell, ascending.
    """
    first = right.searchsorted(left - _ROW)
    parents = left.searchsorted(right - _ROW, "right") - first
    own = np.arange(len(rows))
    root = np.where(parents > 0, first, own)
    for _ in range(_DOUBLINGS):
        root = root.take(root)
    # Left to do: segments with several parents, and those without one between two segments of the row above.
    before, after = rows.take(first - 1, mode="wrap"), rows.take(first, mode="clip")
    between = (parents == 0) & (before == after) & (before == rows - _ROW)
    special = (between | (parents > 1)).nonzero()[0].tolist()
    if not special:
        return root
    joined = _joined(root, special, first.take(special).tolist(), parents.take(special).tolist())
    for segment in joined:
        own[segment] = _find(joined, segment)
    return own.take(root)


def _joined(root: IntArray, special: list[int], first: list[int], parents: list[int]) -> dict[int, int]:
    """Join blobs through special segments, from top to bottom: which root belongs to which earlier one."""
    joined: dict[int, int] = {}
    for segment, parent, count in zip(special, first, parents, strict=True):
        if count:
            # Its own root is that of its first parent.
            for other in root[parent + 1 : parent + count].tolist():
                one, two = sorted((_find(joined, int(root[segment])), _find(joined, other)))
                if one != two:
                    joined[two] = one
        else:
            # It lies in a gap of the row above, within a blob if both neighbours belong to the same one.
            neighbour = _find(joined, int(root[parent - 1]))
            if neighbour == _find(joined, int(root[parent])):
                joined[segment] = neighbour
    return joined


def _find(joined: dict[int, int], segment: int) -> int:
    while segment in joined:
        segment = joined[segment]
    return segment
