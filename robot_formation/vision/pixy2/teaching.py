"""Chroma samples and their bounds: the arithmetic of teaching a signature (Pixy2 behaviour).

The camera teaches on a Bayer picture at half resolution, one quad per 2 x 2 pixels of the RGB picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH, Picture

SCALE_BITS = 15
"""Chroma is a difference divided by a sum, times 2**15."""
DARKEST = 38
"""Quads whose colour sum is smaller give no sample."""
BLOCK = 4
"""Side of the blocks in which a region grows, pixels."""
_SHARE = np.float32(0.8)

IntArray = npt.NDArray[np.int64]
Point = tuple[int, int]


def truncated(numerator: int, denominator: int) -> int:
    """Integer quotient rounded toward zero, for a positive denominator."""
    return numerator // denominator if numerator >= 0 else -(-numerator // denominator)


def packed(red: int, green: int, blue: int) -> int:
    """One number for a colour, 0xRRGGBB."""
    return red << 16 | green << 8 | blue


@dataclass(frozen=True)
class TeachFrame:
    """The half resolution picture: colours (104, 158, 3), chroma (104, 158, 2) and which quads are bright enough."""

    colors: IntArray
    chroma: IntArray
    valid: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, picture: Picture) -> TeachFrame:
        """Average the picture, shape (208, 316, 3), over 2 x 2 pixels and compute the chroma of each quad."""
        colors = picture.reshape(HEIGHT // 2, 2, WIDTH // 2, 2, 3).sum(axis=(1, 3), dtype=np.int64) >> 2
        total = colors.sum(axis=2)
        difference = (colors[..., (0, 2)] - colors[..., 1:2]) << SCALE_BITS
        # Both operands are below 2**24, so that the double's quotient truncates exactly.
        chroma = (difference / np.maximum(total, 1)[..., None]).astype(np.int64)
        return cls(colors, chroma, total >= DARKEST)

    def quads(self, x: int, y: int, width: int, height: int) -> tuple[IntArray, IntArray]:
        """Colours (n, 3) of the quads in a rectangle of pixels, and chroma (m, 2) of those bright enough."""
        column, row = x // 2, y // 2
        window = np.s_[row : row + (height + 1) // 2, column : column + (width + 1) // 2]
        return self.colors[window].reshape(-1, 3), self.chroma[window][self.valid[window]]

    def mean(self, x: int, y: int, width: int, height: int) -> Point:
        """Mean chroma in a rectangle, truncated; (0, 0) without a sample."""
        samples = self.quads(x, y, width, height)[1]
        if not len(samples):
            return 0, 0
        u, v = samples.sum(axis=0).tolist()
        return truncated(u, len(samples)), truncated(v, len(samples))


def bounds(samples: IntArray) -> tuple[int, int, int]:
    """Lower, upper and middle bound of chroma samples, shape (n,): about the 20th and the 80th percentile.

    The camera searches both bounds bit by bit and takes the middle before the last step, so that it can be off by one.
    """
    ordered = np.sort(samples)
    count = np.float32(len(ordered))
    low = high = middle = 0
    for bit in range(30, -1, -1):
        step = 1 << bit
        middle = truncated(low + high, 2)
        above = np.float32(len(ordered) - np.searchsorted(ordered, low, side="right")) / count
        below = np.float32(np.searchsorted(ordered, high, side="left")) / count
        low += step if above > _SHARE else -step
        high -= step if below > _SHARE else -step
    return low, high, middle


def grow(frame: TeachFrame, seed: Point, threshold: int) -> list[Point]:
    """Grow a region of 4 x 4 pixel blocks of like chroma around a pixel.

    Args:
        frame: the teach frame.
        seed: the pixel (x, y) to start from.
        threshold: chroma distance in 1/32768; blocks must be nearer than that to the region's mean.

    Returns:
        Top left pixels (x, y) of the accepted blocks, in the order of acceptance.
    """
    region = _Region(frame, seed)
    while not all(region.closed.values()):
        for side in ("left", "top", "right", "bottom"):
            if not region.closed[side]:
                region.extend(side, threshold)
    return region.blocks


class _Region:
    """A growing rectangle [x0, x1) x [y0, y1), its accepted blocks and their running mean chroma."""

    def __init__(self, frame: TeachFrame, seed: Point) -> None:
        x, y = seed
        self.frame = frame
        self.closed = {
            "left": x < BLOCK,
            "top": y < BLOCK,
            "right": x + BLOCK > WIDTH,
            "bottom": y + BLOCK > HEIGHT,
        }
        self.x0 = x if self.closed["left"] else x - BLOCK
        self.y0 = y if self.closed["top"] else y - BLOCK
        self.x1 = x if self.closed["right"] else x + BLOCK
        self.y1 = y if self.closed["bottom"] else y + BLOCK
        corners = ((x - BLOCK, y), (x - BLOCK, y - BLOCK), (x, y - BLOCK), (x, y))
        self.blocks: list[Point] = [
            (bx, by) for bx, by in corners if self.x0 <= bx < self.x1 and self.y0 <= by < self.y1
        ]
        self.mean = frame.mean(self.x0, self.y0, self.x1 - self.x0, self.y1 - self.y0)

    def extend(self, side: str, threshold: int) -> None:
        """Look at the strip beyond a side: accept its like blocks, then move the side outwards or close it."""
        strip = self._strip(side)
        accepted = sum(self._accept(block, threshold) for block in strip)
        if not strip or 4 * accepted < len(strip):
            self.closed[side] = True
        elif side == "left":
            self.x0 -= BLOCK
        elif side == "top":
            self.y0 -= BLOCK
        elif side == "right":
            self.x1 += BLOCK
        else:
            self.y1 += BLOCK

    def _strip(self, side: str) -> list[Point]:
        """Blocks beyond a side, corners excluded; none if the strip would leave the frame."""
        if side in ("left", "right"):
            x = self.x0 - BLOCK if side == "left" else self.x1
            return [(x, y) for y in range(self.y0, self.y1, BLOCK)] if 0 <= x <= WIDTH - BLOCK else []
        y = self.y0 - BLOCK if side == "top" else self.y1
        return [(x, y) for x in range(self.x0, self.x1, BLOCK)] if 0 <= y <= HEIGHT - BLOCK else []

    def _accept(self, block: Point, threshold: int) -> bool:
        """Append a block whose mean chroma is near the region's, and update the region's."""
        u, v = self.frame.mean(*block, BLOCK, BLOCK)
        mean_u, mean_v = self.mean
        squared = float(np.float32((mean_u - u) ** 2 + (mean_v - v) ** 2))
        if int(math.sqrt(squared)) >= threshold:
            return False
        count = len(self.blocks)
        self.mean = truncated(mean_u * count + u, count + 1), truncated(mean_v * count + v, count + 1)
        self.blocks.append(block)
        return True
