"""From runs of equal labels to row segments: the row scanner's hits, and runs of hits (Pixy2 behaviour).

The loops go cell by cell. Where there is a C compiler they are compiled, with the types of runs.pxd.
"""

from __future__ import annotations

from robot_formation.vision.pixy2.picture import CELLS, HEIGHT

_BRIDGE = 5
"""Hits of one signature belong to one segment up to this many cells from its end to the next hit."""
MOST_SEGMENTS = HEIGHT * ((CELLS + 3) // 4)
"""More segments than a picture can have: hits are at least four cells apart."""


def find_segments(
    picture: memoryview[int],
    labels: memoryview[int],
    bounds: memoryview[int],
    low: memoryview[float],
    high: memoryview[float],
    min_sum: int,
    found: memoryview[int],
) -> int:
    """Find the row segments of all signatures.

    The scanner moves on by one cell without a label, by two after a label without an equal neighbour and by four after
    a pair of equal labels. A pair is a hit if the chroma of both cells together is inside the signature's bounds. Only
    the last segment of a row gets its true first cell, and that of the picture's last row is lost.

    Args:
        picture: red, green and blue of all pixels, row by row.
        labels: signature number or 0 of all cells, row by row.
        bounds: first cell of each run of equal labels within a row, ascending; then the number of cells.
        low: lower bounds of chroma by axis and signature number (see `ColorTable`).
        high: upper bounds, alike.
        min_sum: smallest sum of red, green and blue.
        found: takes the segments, in the order of the scan: signature, row, first and last cell of each, by rows of the
            array; room for MOST_SEGMENTS.

    Returns:
        How many segments there are.
    """
    count = 0
    row = 0
    row_start = 0
    row_stop = 0
    place = 0
    # The segment that the next hit of the row may belong to: none while the signature is 0. Cells count from the row's
    # first; a segment's first cell is the second of its first hit, as the camera has it until the row ends.
    signature = 0
    start = 0
    end = 0
    low_u = high_u = low_v = high_v = 0.0
    for run in range(len(bounds) - 1):
        begin = bounds[run]
        label = labels[begin]
        if label == 0:
            continue
        stop = bounds[run + 1]
        if begin >= row_stop:
            if signature:
                found[0, count] = signature
                found[1, count] = row
                found[2, count] = start - 1
                found[3, count] = end
                count += 1
                signature = 0
            row = begin // CELLS
            row_start = row * CELLS
            row_stop = row_start + CELLS
            place = begin
        elif place < begin:
            place = begin
        if place + 1 < stop:
            low_u, high_u, low_v, high_v = low[0, label], high[0, label], low[1, label], high[1, label]
        while place + 1 < stop:
            # A cell looks at the first of two pixels.
            pixel = 6 * place
            green = picture[pixel + 1] + picture[pixel + 7]
            red = picture[pixel] + picture[pixel + 6]
            blue = picture[pixel + 2] + picture[pixel + 8]
            total = max(red + green + blue, 1)
            # Doubles hold these products exactly.
            weight = float(total)
            u = float(red - green)
            v = float(blue - green)
            if total >= min_sum and low_u * weight < u < high_u * weight and low_v * weight < v < high_v * weight:
                column = place + 1 - row_start
                near = column - end <= _BRIDGE
                if signature == label and near:
                    end = column + 1
                else:
                    if signature:
                        found[0, count] = signature
                        found[1, count] = row
                        found[2, count] = start
                        # A near hit of another signature ends the segment where that one begins.
                        found[3, count] = column if near else end
                        count += 1
                    signature = label
                    start = column
                    end = column + 1
            place += 4
        if place < stop:
            place += 2
    if signature and row < HEIGHT - 1:
        found[0, count] = signature
        found[1, count] = row
        found[2, count] = start - 1
        found[3, count] = end
        count += 1
    return count
