"""Tables by 16-bit value, applied to whole pictures."""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

Entry = TypeVar("Entry", np.uint8, np.float32)


def look_up(table: NDArray[Entry], picture: NDArray[np.uint16], *, out: NDArray[Entry] | None = None) -> NDArray[Entry]:
    """Entry of a table (65536,) for every value of a picture, in the picture's shape; into `out` if that is given."""
    if OPENCV_HAS_WIDE_TABLES:
        return np.asarray(cv2.LUT(picture, table, dst=out), table.dtype)
    return table.take(picture, out=out, mode="clip")


def _opencv_has_wide_tables() -> bool:
    """Whether OpenCV looks 16-bit values up, which is twice as fast as NumPy; older releases take 8-bit ones only."""
    try:
        cv2.LUT(np.zeros((1, 1), np.uint16), np.zeros(65536, np.float32))
    except cv2.error:
        return False
    return True


OPENCV_HAS_WIDE_TABLES = _opencv_has_wide_tables()
