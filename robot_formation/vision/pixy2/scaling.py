"""Brings pictures of other sizes to the camera's."""

from __future__ import annotations

import cv2
import numpy as np

from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH, Picture


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
