"""The colours of a GIF: up to 256, the same for all its pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

_COMMON, _OTHERS = 96, 96
"""Colours that are taken as they are, and that cover the rest."""
_UNKNOWN = -1


class Palette:
    """Colours, and which of them is nearest to any other.

    Pillow's own choice of the nearest goes by the upper six bits of each channel: its white is grey.
    """

    def __init__(self, picture: NDArray[np.uint8]) -> None:
        """Choose the picture's commonest colours, so that plain areas keep theirs, and others that cover the rest.

        Args:
            picture: RGB, (rows, columns, 3).
        """
        colours, counts = np.unique(_packed(picture), return_counts=True)
        common = _unpacked(colours[np.argsort(-counts, kind="stable")[:_COMMON]])
        covering = Image.fromarray(picture).quantize(_OTHERS, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
        others = np.array(covering[: 3 * _OTHERS], np.int64).reshape(-1, 3)
        self.colours = np.vstack([common, others])
        """(n, 3), RGB."""
        self._nearest = np.full(1 << 24, _UNKNOWN, np.int16)  # by packed colour, filled as colours come

    def image(self, picture: NDArray[np.uint8]) -> Image.Image:
        """Return a picture, RGB (rows, columns, 3), in the palette's colours."""
        packed = _packed(picture)
        new = np.unique(packed[self._nearest[packed] == _UNKNOWN])
        for part in np.array_split(new, len(new) // 4096 + 1):
            distances = ((_unpacked(part)[:, None] - self.colours) ** 2).sum(axis=2)
            self._nearest[part] = distances.argmin(axis=1)
        image = Image.fromarray(self._nearest[packed].astype(np.uint8))  # of grey levels until it has its palette
        image.putpalette(self.colours.astype(np.uint8).tobytes())
        return image


def _packed(picture: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return one number per colour."""
    red, green, blue = np.moveaxis(picture.astype(np.uint32), -1, 0)
    return np.asarray(red << 16 | green << 8 | blue)


def _unpacked(colours: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Return red, green and blue, (n, 3)."""
    return np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=-1).astype(np.int64)
