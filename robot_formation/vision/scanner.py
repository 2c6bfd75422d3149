"""From the picture to row segments: labels per cell, hits along each row, runs of hits (Pixy2 behaviour)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from robot_formation.vision.color_table import CENTRE, ColorTable
from robot_formation.vision.picture import CELLS, HEIGHT, WIDTH, Picture
from robot_formation.vision.teaching import SCALE_BITS, IntArray

_STEP = 4
"""Cells from one hit to the next in a run of equal labels."""
_PAST = np.array([(0, 1, 2, 1)[rest % 4] for rest in range(CELLS + 1)] + [1])
"""Cells that the scanner goes past a run's end, by the run's cells from the first one looked at (last entry: -1)."""
_CHROMA_SCALE = float(1 << SCALE_BITS)
_BRIDGE = 6
"""Hits of one signature up to this many cells apart belong to one segment."""


class Segments(NamedTuple):
    """Row segments in the order of the scan, each array of shape (n,): a segment covers cells start..end inclusive."""

    signature: IntArray
    row: IntArray
    start: IntArray
    end: IntArray


_NONE = Segments(*[np.empty(0, np.int64)] * 4)


class Scanner:
    """Finds the row segments of a picture. It keeps its working memory between frames.

    Args:
        table: which colour differences belong to which signature.
    """

    def __init__(self, table: ColorTable) -> None:
        self._table = table
        cells = HEIGHT * CELLS
        self._channels = np.empty((3, HEIGHT, WIDTH), np.uint8)
        # Red, green and blue of the pixels that the cells look at, and what follows from them cell by cell.
        self._planes = np.empty((3, HEIGHT, CELLS), np.uint8)
        self._bins = np.empty((HEIGHT, CELLS, 2), np.uint8)
        self._iu, self._iv = np.empty((2, HEIGHT, CELLS), np.uint8)
        self._index = np.empty(cells, np.intp)
        self._labels = np.empty(cells, np.uint8)
        self._change = np.empty(cells + 1, np.bool_)

    def scan(self, picture: Picture) -> Segments:
        """Find the row segments of all signatures in a picture of shape (208, 316, 3), uint8."""
        table = self._table
        self._label(picture)
        first, signature = self._hits()
        if not len(first):
            return _NONE
        flat = self._planes.reshape(3, -1)
        colors = flat.take(first, axis=1).astype(np.int32) + flat.take(first + 1, axis=1)
        total = np.maximum(colors[0] + colors[1] + colors[2], 1)
        # Exact: both operands are below 2**25, where the double's quotient truncates as the integer division does.
        chroma = np.trunc((colors[::2] - colors[1]) * _CHROMA_SCALE / total)
        inside = (chroma > table.low.take(signature, axis=1)) & (chroma < table.high.take(signature, axis=1))
        kept = (inside[0] & inside[1] & (total >= table.min_sum)).nonzero()[0]
        if not len(kept):
            return _NONE
        row, column = np.divmod(first[kept], CELLS)
        return _segments(signature[kept], row, column + 1)

    def _label(self, picture: Picture) -> None:
        """Look up the signature number or 0 of each cell."""
        cv2.split(picture, list(self._channels))
        # A cell looks at the first of two pixels: the low byte of both, read as one little-endian number.
        np.copyto(self._planes, self._channels.view("<u2"), casting="unsafe")
        red, green, blue = self._planes
        # d / 8 + 32 - 7/16 rounds to (d >> 3) + 32 for every integer d; one vectorised pass instead of four.
        offset = CENTRE - 0.4375
        cv2.addWeighted(red, 0.125, green, -0.125, offset, dst=self._iu)
        cv2.addWeighted(blue, 0.125, green, -0.125, offset, dst=self._iv)
        # The two bytes of a cell, read as one little-endian number, are iv + 256 * iu.
        cv2.merge((self._iv, self._iu), dst=self._bins)
        self._index[:] = self._bins.view("<u2").ravel()
        # Every index is inside the table; mode "clip" only spares numpy a copy.
        self._table.labels.take(self._index, out=self._labels, mode="clip")

    def _hits(self) -> tuple[IntArray, IntArray]:
        """First cells (index 158 * row + column) and signatures of the pairs of equal labels that are stored.

        The scanner moves on by one cell without a label, by two after a label without an equal neighbour and by four
        after a pair. So a run of equal labels yields a hit every four cells from where the scanner enters it, and how
        far it enters depends on the run before it only if that is nearer than two cells.
        """
        labels, change = self._labels, self._change
        np.not_equal(labels[1:], labels[:-1], out=change[1:-1])
        change[::CELLS] = True
        bounds = change.nonzero()[0]
        label = labels[bounds[:-1]]
        runs = label.nonzero()[0]
        start, stop = bounds[runs], bounds[runs + 1]
        rest = stop - start - _entries(start, stop)
        count = np.maximum(rest + 2, 0) >> 2
        before = count.cumsum() - count
        first = np.repeat(stop - rest - _STEP * before, count)
        first += _STEP * np.arange(len(first))
        return first, np.repeat(label[runs].astype(np.int64), count)


def _entries(start: IntArray, stop: IntArray) -> IntArray:
    """Cells of each run [start, stop) that the scanner skips before it looks at one; may exceed the run."""
    entry = np.zeros(len(start), np.int64)
    gap = start[1:] - stop[:-1]
    near = (gap < 2).nonzero()[0]
    near = near[start[near + 1] // CELLS == start[near] // CELLS]
    if not len(near):
        return entry
    gap = gap[near]
    length = (stop - start)[near]
    # Each entry follows from the one before it alone: the sweeps end with the only solution, mostly after two or three.
    while True:
        settled = np.maximum(_PAST.take(length - entry[near]) - gap, 0)
        if (settled == entry[near + 1]).all():
            return entry
        entry[near + 1] = settled


def _segments(signature: IntArray, row: IntArray, column: IntArray) -> Segments:
    """Join hits to segments.

    Only the last segment of a row gets its true first cell, and that of the picture's last row is lost.
    """
    # What follows a hit: nothing near in its row, a near hit of its signature, or a near hit of another one.
    count = len(column)
    closed, last, cut = np.ones((3, count), np.bool_)
    np.not_equal(row[1:], row[:-1], out=closed[:-1])
    near = (column[1:] - column[:-1] <= _BRIDGE) & ~closed[:-1]
    same = signature[1:] == signature[:-1]
    last[:-1] = ~(near & same)
    cut[:-1] = near & ~same
    cut[-1] = False
    final = last.nonzero()[0]
    first = np.zeros_like(final)
    first[1:] = final[:-1] + 1
    end = column[final] + 1
    # A near hit of another signature ends the segment where that one begins.
    cut_at = final[cut[final]]
    end[cut[final]] = column[cut_at + 1]
    segments = Segments(signature[final], row[final], column[first] - closed[final], end)
    if segments.row[-1] == HEIGHT - 1:
        return Segments(*(array[:-1] for array in segments))
    return segments
