"""Row segments: what the scanner finds and blobs are made of."""

from __future__ import annotations

from typing import NamedTuple

from robot_formation.vision.pixy2.teaching import IntArray


class Segments(NamedTuple):
    """Row segments in the order of the scan, each array of shape (n,): a segment covers cells start..end inclusive."""

    signature: IntArray
    row: IntArray
    start: IntArray
    end: IntArray
