"""From row segments to blobs: one pass over the rows, connecting what overlaps the row above (Pixy2 behaviour)."""

from __future__ import annotations

from collections.abc import Iterable

from robot_formation.vision.strands import Strand

_NO_ROW = -1


class Blob:
    """A connected component in cells (columns) and rows, all inclusive.

    `row`, `start` and `end` span its most recent finished row, `next_*` the row being built (next_row -1: none).
    """

    __slots__ = ("area", "end", "left", "next_end", "next_row", "next_start", "right", "row", "start", "top")

    def __init__(self, row: int, start: int, end: int) -> None:
        self.left = start
        self.right = end
        self.top = row
        self.area = end - start + 1
        self.row = row
        self.start = start
        self.end = end
        self.next_row = _NO_ROW
        self.next_start = start
        self.next_end = end

    def attach(self, row: int, start: int, end: int) -> None:
        """Add a segment of the row being built."""
        self.area += end - start + 1
        if start < self.left:
            self.left = start
        if end > self.right:
            self.right = end
        if self.next_row == _NO_ROW:
            self.next_row = row
            self.next_start = start
        self.next_end = end

    def extend(self, strand: Strand) -> None:
        """Add the rows of a strand after its first one, which is part of the blob already."""
        _, start, end, last, last_start, last_end, left, right, area = strand
        self.left = min(self.left, left)
        self.right = max(self.right, right)
        self.area += area - (end - start + 1)
        self.next_row = last
        self.next_start = last_start
        self.next_end = last_end

    def absorb(self, other: Blob) -> None:
        """Take over a blob to the right that the row being built connects to this one."""
        self.area += other.area
        self.left = min(self.left, other.left)
        self.right = max(self.right, other.right)
        self.top = min(self.top, other.top)
        self.end = max(self.end, other.end)

    def finish_row(self) -> None:
        """Make the row being built the most recent finished one."""
        if self.next_row != _NO_ROW:
            self.row = self.next_row
            self.start = self.next_start
            self.end = self.next_end
            self.next_row = _NO_ROW


def connect(strands: Iterable[Strand]) -> list[Blob]:
    """Connect the strands of one signature, in the order of the scan, to blobs, largest area first.

    A strand joins a blob that it overlaps or touches by one column, diagonals included, on the row above. The blobs
    that can still grow are kept from left to right; a new one goes before the cursor, out of reach of its own row.
    """
    active: list[Blob] = []
    finished: list[Blob] = []
    current = _NO_ROW
    cursor = 0
    for strand in strands:
        row, start, end, last_row = strand[:4]
        if row != current:
            current = row
            cursor = 0
            _refresh(active, 0, row, finished)
            _refresh(active, 1, row, finished)
        while cursor < len(active):
            blob = active[cursor]
            if start > blob.end:
                cursor += 1
                _refresh(active, cursor + 1, row, finished)
                continue
            if end < blob.start:
                blob = Blob(row, start, end)
                active.insert(cursor, blob)
                cursor += 1
                break
            blob.attach(row, start, end)
            following = cursor + 1
            while following < len(active) and end >= active[following].start:
                blob.absorb(active.pop(following))
                _refresh(active, following, row, finished)
            break
        else:
            blob = Blob(row, start, end)
            active.append(blob)
            cursor += 1
        if last_row > row:
            blob.extend(strand)
            _finish_others(active, blob, finished)
    for blob in active:
        blob.finish_row()
    # The camera puts each finished blob in front of the earlier ones: that decides among equal areas.
    return sorted([*reversed(active), *reversed(finished)], key=_by_area)


def _by_area(blob: Blob) -> int:
    return -blob.area


def _finish_others(active: list[Blob], blob: Blob, finished: list[Blob]) -> None:
    """Finish all blobs but one, to which alone the next row belongs."""
    for other in active:
        if other is not blob:
            other.finish_row()
            if other.row - other.top > 1:
                finished.append(other)
    active[:] = [blob]


def _refresh(active: list[Blob], position: int, row: int, finished: list[Blob]) -> None:
    """Bring the blob at a position up to date for a row, first removing those that missed a row."""
    while position < len(active):
        blob = active[position]
        if blob.next_row != _NO_ROW:
            blob.finish_row()
        if row - blob.row <= 1:
            return
        del active[position]
        if blob.row - blob.top > 1:
            finished.append(blob)
