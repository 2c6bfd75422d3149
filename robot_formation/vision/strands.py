"""Strands: row segments of one signature, joined over successive rows where the outcome is plain.

A blob is mostly one segment per row, each overlapping the one above. Joining these at once saves most of the work of
connecting segments one after the other, and gives the same blobs.
"""

from __future__ import annotations

import itertools

import numpy as np

from robot_formation.vision.scanner import Segments

Strand = tuple[int, int, int, int, int, int, int, int, int]
"""First row and its start and end, last row and its start and end, smallest start, largest end, area (all cells)."""

_ROWS = 256
"""More than a picture has, so that no signature's rows follow those of the one before it."""


def strands(segments: Segments) -> dict[int, list[Strand]]:
    """Strands of each signature in the order of the scan; a segment that can't be joined is a strand by itself.

    Segments are joined where each is the only one of its signature in its row and they overlap from row to row.
    """
    if not len(segments.row):
        return {}
    order = segments.signature.argsort(kind="stable")
    signature, row, start, end = (array[order] for array in segments)
    place = signature * _ROWS + row
    step = place[1:] - place[:-1]
    joined = (step == 1) & (start[1:] <= end[:-1]) & (end[1:] >= start[:-1])
    shared = step == 0
    joined[1:] &= ~shared[:-1]
    joined[:-1] &= ~shared[1:]
    tails = np.append((~joined).nonzero()[0], len(row) - 1)
    heads = np.zeros_like(tails)
    heads[1:] = tails[:-1] + 1
    columns = [array[heads] for array in (row, start, end)]
    columns += [array[tails] for array in (row, start, end)]
    columns.append(np.minimum.reduceat(start, heads))
    columns.append(np.maximum.reduceat(end, heads))
    columns.append(np.add.reduceat(end - start + 1, heads))
    listed: list[Strand] = list(zip(*(column.tolist() for column in columns), strict=True))
    numbers = signature[heads]
    limits = [0, *((numbers[1:] != numbers[:-1]).nonzero()[0] + 1).tolist(), len(listed)]
    return {int(numbers[begin]): listed[begin:stop] for begin, stop in itertools.pairwise(limits)}
