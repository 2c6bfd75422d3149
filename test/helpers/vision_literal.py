"""A slow, literal reading of the camera's rules, one cell, hit, segment and box after the other, to compare with.

Nothing here is shared with the package except the stored signatures and the parameters.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import Signature


def divide(numerator: int, denominator: int) -> int:
    """Integer division as in C."""
    quotient = abs(numerator) // abs(denominator)
    return quotient if (numerator < 0) == (denominator < 0) else -quotient


class LiteralDetector:
    def __init__(self, signatures: Sequence[Signature], parameters: DetectorParameters) -> None:
        self.parameters = parameters
        self.min_y = max(1, int(np.float32(765) * np.float32(parameters.min_brightness)))
        self.limits = {}
        for s in sorted(signatures, key=lambda s: s.sig):
            if s.u_min == 0 and s.u_max == 0:
                continue
            gain = np.float32(parameters.signature_range[s.sig - 1])
            self.limits[s.sig] = [
                int(np.float32(mean) + np.float32(bound - mean) * gain)
                for bound, mean in (
                    (s.u_min, s.u_mean),
                    (s.u_max, s.u_mean),
                    (s.v_min, s.v_mean),
                    (s.v_max, s.v_mean),
                )
            ]
        self.table = self._table()

    def _inside(self, sig: int, u: int, v: int) -> bool:
        u_min, u_max, v_min, v_max = self.limits[sig]
        return u_min < u < u_max and v_min < v < v_max

    def _table(self) -> list[int]:
        table = [0] * 4096
        for r in range(0, 256, 4):
            for g in range(0, 256, 4):
                for b in range(0, 256, 4):
                    y = r + g + b
                    if y < self.min_y:
                        continue
                    u = divide((r - g) * 32768, y)
                    v = divide((b - g) * 32768, y)
                    for sig in self.limits:
                        if self._inside(sig, u, v):
                            index = 64 * (((r - g) >> 3) & 63) + (((b - g) >> 3) & 63)
                            if table[index] == 0 or sig < table[index]:
                                table[index] = sig
                            break
        return table

    def hits(self, picture: npt.NDArray[np.uint8], y: int) -> list[tuple[int, int, int, int, int]]:
        """Hits (signature, column, u, v, sum) of row y."""
        cells = picture[y, ::2].tolist()
        label = [self.table[64 * (((r - g) >> 3) & 63) + (((b - g) >> 3) & 63)] for r, g, b in cells]
        found = []
        i = 0
        while i < 158:
            if label[i] == 0:
                i += 1
                continue
            if i + 1 == 158:
                break
            if label[i + 1] != label[i]:
                i += 2
                continue
            (r0, g0, b0), (r1, g1, b1) = cells[i], cells[i + 1]
            found.append((label[i], i + 1, r0 - g0 + r1 - g1, b0 - g0 + b1 - g1, r0 + g0 + b0 + r1 + g1 + b1))
            i += 4
        return found

    def row_segments(self, picture: npt.NDArray[np.uint8]) -> list[tuple[int, int, int, int]]:
        """Segments (signature, row, start, length)."""
        output = []
        for y in range(208):
            current = None
            for sig, k, u, v, total in self.hits(picture, y):
                c = total or 1
                if not self._inside(sig, divide(u * 32768, c), divide(v * 32768, c)) or c < self.min_y:
                    continue
                if current is None:
                    current = [sig, k, k + 1]
                elif current[0] == sig and k - current[2] <= 5:
                    current[2] = k + 1
                else:
                    if current[0] != sig and k - current[2] <= 5:
                        current[2] = k
                    output.append((current[0], y, current[1], current[2] - current[1]))
                    current = [sig, k, k + 1]
            if current is not None and y != 207:
                output.append((current[0], y, current[1] - 1, current[2] - current[1] + 1))
        return output

    def detect(self, picture: npt.NDArray[np.uint8]) -> list[tuple[int, int, int, int, int]]:
        """Boxes (signature, left, right, top, bottom)."""
        segments = self.row_segments(picture)
        parameters = self.parameters
        boxes: list[list[int]] = []
        stored = 0
        for sig in self.limits:
            mine: list[list[int]] = []
            blobs = connected([(y, start, start + length) for s, y, start, length in segments if s == sig])
            for blob in blobs[: parameters.max_blocks_per_signature]:
                if stored == parameters.max_blocks:
                    break
                if blob["area"] < parameters.min_block_area or blob["last"][0] - blob["top"] <= 1:
                    continue
                mine.append([sig, 2 * blob["left"], 2 * blob["right"], blob["top"], blob["last"][0]])
                stored += 1
            boxes += merged(mine, parameters.max_merge_dist)
        return [(sig, left, right, top, bottom) for sig, left, right, top, bottom in denested(boxes)]


Blob = dict[str, Any]
"""Sides `left`, `right` and `top`, `area`, and the rows `last` and `next`: [row, start, end], or None."""


def connected(segments: Sequence[tuple[int, int, int]]) -> list[Blob]:
    """Blobs of one signature, largest area first; `last` and `next` are [row, start, end] or None."""
    blobs: list[Blob] = []
    finished: list[Blob] = []
    current_row = -1
    cursor = 0

    def check(position: int) -> None:
        while position < len(blobs):
            blob = blobs[position]
            if blob["next"]:
                blob["last"], blob["next"] = blob["next"], None
            if current_row - blob["last"][0] <= 1:
                break
            blobs.pop(position)
            if blob["last"][0] - blob["top"] > 1:
                finished.insert(0, blob)

    for row, s, e in segments:
        if row != current_row:
            current_row = row
            check(0)
            cursor = 0
            if blobs:
                check(1)
        attached = False
        while cursor < len(blobs):
            blob = blobs[cursor]
            if s > blob["last"][2]:
                cursor += 1
                if cursor < len(blobs):
                    check(cursor + 1)
            elif e < blob["last"][1]:
                break
            else:
                attached = True
                blob["left"], blob["right"] = min(blob["left"], s), max(blob["right"], e)
                blob["top"] = min(blob["top"], row)
                blob["area"] += e - s + 1
                if blob["next"]:
                    blob["next"][2] = e
                else:
                    blob["next"] = [row, s, e]
                while cursor + 1 < len(blobs) and e >= blobs[cursor + 1]["last"][1]:
                    other = blobs.pop(cursor + 1)
                    blob["area"] += other["area"]
                    blob["left"], blob["right"] = min(blob["left"], other["left"]), max(blob["right"], other["right"])
                    blob["top"] = min(blob["top"], other["top"])
                    blob["last"][2] = max(blob["last"][2], other["last"][2])
                    check(cursor + 1)
                break
        if not attached:
            new: Blob = {"left": s, "right": e, "top": row, "area": e - s + 1, "last": [row, s, e], "next": None}
            blobs.insert(cursor, new)
            cursor += 1
    for blob in blobs:
        if blob["next"]:
            blob["last"] = blob["next"]
        finished.insert(0, blob)
    return sorted(finished, key=lambda blob: -blob["area"])


def merged(boxes: list[list[int]], distance: int) -> list[list[int]]:
    alive = [True] * len(boxes)
    changed = True
    while changed:
        changed = False
        for i in range(len(boxes)):
            for j in range(i + 1, len(boxes)):
                if alive[i] and alive[j]:
                    horizontally = try_merge(boxes[i], boxes[j], 1, 3, distance)
                    vertically = try_merge(boxes[i], boxes[j], 3, 1, distance)
                    if horizontally or vertically:
                        alive[j] = False
                        changed = True
    return [box for box, is_alive in zip(boxes, alive, strict=True) if is_alive]


def try_merge(box: list[int], other: Sequence[int], along: int, across: int, m: int) -> bool:
    """Try one axis; `along` and `across` index the lower sides, the upper ones follow."""
    A0, B0, C0, D0 = box[along], box[along + 1], box[across], box[across + 1]
    A1, B1, C1, D1 = other[along], other[along + 1], other[across], other[across + 1]
    if not (C0 <= D1 and C1 <= D0):
        return False
    if A1 <= A0 and (A0 <= B1 <= B0 or 0 <= A0 - B1 <= m):
        box[along] = A1
    elif A0 <= A1 and (A1 <= B0 <= B1 or 0 <= A1 - B0 <= m):
        box[along + 1] = B1
    else:
        return False
    box[across], box[across + 1] = min(C0, C1), max(D0, D1)
    return True


def denested(boxes: list[list[int]]) -> list[list[int]]:
    def contains(a: Sequence[int], b: Sequence[int]) -> bool:
        return a[1] <= b[1] and b[2] <= a[2] and a[3] <= b[3] and b[4] <= a[4]

    alive = [True] * len(boxes)
    for i in range(len(boxes)):
        if not alive[i]:
            continue
        for j in range(i + 1, len(boxes)):
            if not alive[j]:
                continue
            if contains(boxes[i], boxes[j]):
                alive[j] = False
            elif contains(boxes[j], boxes[i]):
                alive[i] = False
    return [box for box, is_alive in zip(boxes, alive, strict=True) if is_alive]
