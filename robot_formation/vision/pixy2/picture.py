"""The camera's picture: its size, the detection grid, and the check that every entry point makes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from robot_formation.errors import FormationError

WIDTH = 316
"""Columns of the reported frame, pixels."""
HEIGHT = 208
"""Rows of the reported frame, pixels."""
CELLS = WIDTH // 2
"""Columns of the detection grid: cell i looks at the pixel x = 2 i only."""

Picture = npt.NDArray[np.uint8]


class PictureError(FormationError):
    """A picture has the wrong shape or type; the text says what is expected."""


def checked(picture: ArrayLike) -> Picture:
    """Return the picture as a contiguous array.

    Args:
        picture: RGB, shape (208, 316, 3), uint8.

    Raises:
        PictureError: if it is anything else.
    """
    if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8:
        kind = picture.dtype if isinstance(picture, np.ndarray) else type(picture).__name__
        raise PictureError(f"the picture must be an array of uint8, not {kind}; convert it to 8 bit RGB")
    if picture.shape != (HEIGHT, WIDTH, 3):
        raise PictureError(
            f"the picture must have shape ({HEIGHT}, {WIDTH}, 3), not {picture.shape}; scale it to that size"
        )
    return np.ascontiguousarray(picture)
