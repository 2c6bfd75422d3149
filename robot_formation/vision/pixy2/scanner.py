"""From the picture to row segments: a label per cell, runs of equal labels, hits along each row (Pixy2 behaviour)."""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from robot_formation.vision.look_up import look_up
from robot_formation.vision.pixy2.color_table import STRIDE, ColorTable
from robot_formation.vision.pixy2.picture import CELLS, HEIGHT, Picture
from robot_formation.vision.pixy2.runs import MOST_SEGMENTS, find_segments
from robot_formation.vision.pixy2.segments import Segments
from robot_formation.vision.pixy2.teaching import IntArray


class Scanner:
    """Finds the row segments of a picture. It keeps its working memory between frames.

    Args:
        table: which colour differences belong to which signature.
    """

    def __init__(self, table: ColorTable) -> None:
        self._table = table
        # A cell looks at the first of two pixels, hence at the first three of six bytes. As numbers of two bytes these
        # are red + 256 * green, blue and what is not looked at, and green of the second pixel and so on.
        self._pairs = np.empty((3, HEIGHT, CELLS), np.uint16)
        self._channels = list(self._pairs)
        self._green = np.empty((HEIGHT, CELLS), np.uint16)
        self._red_blue = np.empty((2, HEIGHT, CELLS), np.uint16)
        # Differences are below zero, or beyond 65000 without sign.
        self._bins = self._red_blue.view(np.int16)
        # Its numbers repeat, so that every 16-bit index finds what it means, without sign too.
        self._by_index = np.tile(table.labels, (1 << 16) // len(table.labels))
        self._labels = np.empty(HEIGHT * CELLS, np.uint8)
        self._change = np.empty(HEIGHT * CELLS + 1, np.bool_)
        self._found = np.empty((4, MOST_SEGMENTS), np.intp)
        # In Python, numbers from a memoryview are faster than those from an array.
        self._views = self._labels.data, self._found.data
        self._chroma = cast("memoryview[float]", table.low.data), cast("memoryview[float]", table.high.data)

    def scan(self, picture: Picture) -> Segments:
        """Find the row segments of all signatures in a picture of shape (208, 316, 3), uint8, contiguous."""
        self._label(picture)
        labels, found = self._views
        low, high = self._chroma
        count = find_segments(picture.ravel().data, labels, self._runs().data, low, high, self._table.min_sum, found)
        return Segments(*self._found[:, :count].copy())

    def _label(self, picture: Picture) -> None:
        """Look up the signature number or 0 of each cell."""
        cv2.split(picture.reshape(HEIGHT, -1).view("<u2").reshape(HEIGHT, CELLS, 3), self._channels)
        red_blue, green, bins = self._red_blue, self._green, self._bins
        np.right_shift(self._pairs[0], 8, out=green)
        np.bitwise_and(self._pairs[:2], 255, out=red_blue)
        np.subtract(red_blue, green, out=red_blue)
        np.right_shift(bins, 3, out=bins)
        np.multiply(bins[0], STRIDE, out=bins[0])
        np.add(bins[0], bins[1], out=bins[0])
        look_up(self._by_index, red_blue[0], out=self._labels.reshape(HEIGHT, CELLS))

    def _runs(self) -> IntArray:
        """First cell of each run of equal labels within a row; then the number of cells."""
        labels, change = self._labels, self._change
        np.not_equal(labels[1:], labels[:-1], out=change[1:-1])
        change[::CELLS] = True
        return change.nonzero()[0]
