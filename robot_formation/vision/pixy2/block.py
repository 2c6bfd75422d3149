"""A block as a Pixy2 reports it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Block:
    """One reported block: centre, width and height in pixels of the 316 x 208 picture (Pixy2 getBlocks record).

    `angle` is in degrees and 0 unless the block is a colour code; `index` is the tracker's running number (0..255) and
    `age` the frames since the block was first reported (0..255).
    """

    signature: int
    x: int
    y: int
    width: int
    height: int
    angle: int = 0
    index: int = 0
    age: int = 0
