"""Which pixels of a picture belong to which signature, by the rule of the row scanner."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from robot_formation.vision.pixy2.color_table import STRIDE, ColorTable
from robot_formation.vision.pixy2.picture import Picture, checked


def matching_signatures(picture: Picture, table: ColorTable) -> npt.NDArray[np.uint8]:
    """Find the signature of every pixel, 0 where there is none.

    A cell of 2 x 1 px counts if it and a neighbour in its row have the same entry in the colour table, and the chroma
    of both together is inside the signature's bounds. The scanner, which skips cells, looks at some of these pairs.

    Args:
        picture: RGB, shape (208, 316, 3), uint8.
        table: the signatures at their ranges.

    Returns:
        Numbers of signatures, shape (208, 316).

    Raises:
        PictureError: if the picture has another shape or type.
    """
    cells = checked(picture)[:, ::2].astype(np.int32)
    red, green, blue = np.moveaxis(cells, 2, 0)
    bins = (red - green >> 3) * STRIDE + (blue - green >> 3)
    labels = table.labels[bins]
    pairs = cells[:, :-1] + cells[:, 1:]
    total = np.maximum(pairs.sum(axis=2), 1)
    label = np.where(labels[:, :-1] == labels[:, 1:], labels[:, :-1], 0)
    inside = (label > 0) & (total >= table.min_sum)
    for axis, channel in enumerate((0, 2)):
        difference = pairs[..., channel] - pairs[..., 1]
        inside &= (difference > table.low[axis][label] * total) & (difference < table.high[axis][label] * total)
    found = np.zeros(labels.shape, np.uint8)
    found[:, :-1][inside] = label[inside]
    found[:, 1:][inside] = label[inside]
    return np.repeat(found, 2, axis=1)
