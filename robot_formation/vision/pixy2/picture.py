"""The camera's picture: its size, the detection grid, and the check that every entry point makes."""

from __future__ import annotations

import cv2
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


def scaled(picture: Picture) -> Picture:
    """Bring an RGB (or BGR) picture of any size, shape (rows, columns, 3), to the camera's size.

    Squares stay squares: what a picture of another shape leaves free, above and below or on both sides, is black, which
    no signature matches.
    """
    if picture.shape[:2] == (HEIGHT, WIDTH):
        return picture
    rows, columns = (HEIGHT, WIDTH) if same_shape(picture) else _fitting(*picture.shape[:2])
    resized = cv2.resize(np.ascontiguousarray(picture), (columns, rows), interpolation=cv2.INTER_AREA)
    whole = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    top, left = (HEIGHT - rows) // 2, (WIDTH - columns) // 2
    whole[top : top + rows, left : left + columns] = resized
    return whole


def same_shape(picture: Picture) -> bool:
    """Whether a picture's sides are as 316 to 208, to within a pixel of the scaled picture."""
    rows, columns = _fitting(*picture.shape[:2])
    return rows >= HEIGHT - 1 and columns >= WIDTH - 1


def _fitting(rows: int, columns: int) -> tuple[int, int]:
    """Rows and columns of a picture that is scaled to fit into the camera's, at least one each."""
    scale = min(HEIGHT / max(1, rows), WIDTH / max(1, columns))
    return max(1, round(rows * scale)), max(1, round(columns * scale))
