"""From the picture to row segments: labels per cell, hits along each row, runs of hits (Pixy2 behaviour)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from robot_formation.vision.pixy2.color_table import CENTRE, ColorTable
from robot_formation.vision.pixy2.picture import CELLS, HEIGHT, WIDTH, Picture
from robot_formation.vision.pixy2.teaching import IntArray

_STEP = 4
"""Cells from one hit to the next in a run of equal labels."""
_SKIPPED = np.array([0, 1, 2, 1, 0, 0, 1, 0])
"""Cells of a run that the scanner skips before it looks at one, by the cells of the run before it from the first one
looked at, modulo 4; then the same for runs with a gap of one cell before them."""
_BRIDGE = 6
"""Hits of one signature up to this many cells apart belong to one segment."""
_PITCH = CELLS + _BRIDGE
"""Places from one row to the next in the scanner's memory: so hits in different rows are always farther apart."""


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
        places = HEIGHT * _PITCH
        channels = np.empty((3, HEIGHT, WIDTH), np.uint8)
        self._channels = list(channels)
        # A cell looks at the first of two pixels: the low byte of both, read as one little-endian number.
        self._pairs = channels.view("<u2")
        # Red, green and blue of the cells, and what follows from them cell by cell. Rows are _PITCH places apart; the
        # places between them have no label.
        self._planes = np.zeros((3, HEIGHT, _PITCH), np.uint8)
        self._cells = self._planes[:, :, :CELLS]
        self._iu, self._iv = np.empty((2, HEIGHT, _PITCH), np.uint8)
        self._bins = np.empty((HEIGHT, _PITCH, 2), np.uint8)
        # The two bytes of a cell, read as one little-endian number, are iv + 256 * iu.
        self._index = self._bins.view("<u2").ravel()
        self._labels = np.empty(places, np.uint8)
        self._unused = self._labels.reshape(HEIGHT, _PITCH)[:, CELLS:]
        self._change = np.ones(places + 1, np.bool_)
        self._steps = _STEP * np.arange(places // 2)

    def scan(self, picture: Picture) -> Segments:
        """Find the row segments of all signatures in a picture of shape (208, 316, 3), uint8."""
        table = self._table
        self._label(picture)
        first, signature = self._hits()
        if not len(first):
            return _NONE
        flat = self._planes.reshape(3, -1)
        colors = flat.take(first, axis=1).astype(np.int16) + flat.take(first + 1, axis=1)
        red, green, blue = colors
        total = np.maximum(red + green + blue, 1)
        # Doubles hold these products exactly.
        difference = colors[::2] - green
        above = difference > table.low.take(signature, axis=1) * total
        below = difference < table.high.take(signature, axis=1) * total
        inside = above & below
        kept = (inside[0] & inside[1] & (total >= table.min_sum)).nonzero()[0]
        return _segments(signature.take(kept), first.take(kept)) if len(kept) else _NONE

    def _label(self, picture: Picture) -> None:
        """Look up the signature number or 0 of each cell."""
        cv2.split(picture, self._channels)
        np.copyto(self._cells, self._pairs, casting="unsafe")
        red, green, blue = self._planes
        # d / 8 + 32 - 7/16 rounds to (d >> 3) + 32 for every integer d; one vectorised pass instead of four.
        offset = CENTRE - 0.4375
        cv2.addWeighted(red, 0.125, green, -0.125, offset, dst=self._iu)
        cv2.addWeighted(blue, 0.125, green, -0.125, offset, dst=self._iv)
        cv2.merge((self._iv, self._iu), dst=self._bins)
        # Every index is inside the table; mode "clip" only spares numpy a copy.
        self._table.labels.take(self._index, out=self._labels, mode="clip")
        self._unused[:] = 0

    def _hits(self) -> tuple[IntArray, IntArray]:
        """First cells (index _PITCH * row + column) and signatures of the pairs of equal labels that are stored.

        The scanner moves on by one cell without a label, by two after a label without an equal neighbour and by four
        after a pair. So a run of equal labels yields a hit every four cells from where the scanner enters it, and how
        far it enters depends on the run before it only if that is nearer than two cells.
        """
        labels, change = self._labels, self._change
        np.not_equal(labels[1:], labels[:-1], out=change[1:-1])
        bounds = change.nonzero()[0]
        label = labels.take(bounds[:-1])
        runs = label.nonzero()[0]
        start, stop = bounds.take(runs), bounds.take(runs + 1)
        rest = _rests(start, stop)
        count = np.maximum(rest + 2, 0) >> 2
        before = count.cumsum() - count
        first = (stop - rest - _STEP * before).repeat(count)
        first += self._steps[: len(first)]
        return first, label.take(runs).astype(np.int64).repeat(count)


def _rests(start: IntArray, stop: IntArray) -> IntArray:
    """Cells of each run [start, stop) from the first one that the scanner looks at; -1 or less if it skips the run."""
    rest = stop - start
    gap = start[1:] - stop[:-1]
    near = (gap < 2).nonzero()[0]
    if not len(near):
        return rest
    after, case = near + 1, _STEP * gap.take(near)
    length = rest.take(after)
    # Each rest follows from the one before it alone: the sweeps end with the only solution, mostly after two or three.
    while True:
        settled = length - _SKIPPED.take(case + (rest.take(near) & _STEP - 1))
        if (settled == rest.take(after)).all():
            return rest
        rest[after] = settled


def _segments(signature: IntArray, place: IntArray) -> Segments:
    """Join hits to segments.

    Only the last segment of a row gets its true first cell, and that of the picture's last row is lost.

    Args:
        signature: of each hit, shape (n,).
        place: of each hit's first cell (index _PITCH * row + column), ascending.
    """
    # What follows a hit: nothing near in its row, a near hit of another signature, or a near hit of its own.
    last = np.ones(len(place), np.bool_)
    far = place[1:] - place[:-1] > _BRIDGE
    np.logical_or(far, signature[1:] != signature[:-1], out=last[:-1])
    final = last.nonzero()[0]
    first = np.zeros_like(final)
    first[1:] = final[:-1] + 1
    row, start = np.divmod(place.take(first), _PITCH)
    end = place.take(final) - row * _PITCH + 2
    # A near hit of another signature ends the segment where that one begins.
    cut = (~far.take(final[:-1])).nonzero()[0]
    end[cut] = start.take(cut + 1) + 1
    start[:-1] += row[1:] == row[:-1]
    found = Segments(signature.take(final), row, start, end)
    if row[-1] == HEIGHT - 1:
        return Segments(*(array[:-1] for array in found))
    return found
