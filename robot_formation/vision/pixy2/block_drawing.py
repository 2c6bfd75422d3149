"""Pictures to look at: what a camera saw, with its blocks, or with the pixels that its signatures match."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.parameters import SIGNATURES
from robot_formation.vision.pixy2.picture import Picture, PictureError

SCALE = 3
"""Pixels of a drawing per pixel of the picture."""
# Okabe and Ito's colours (RGB), which the colour-blind tell apart; by number of the signature, the eighth for codes.
_COLOURS = (
    *((230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66)),
    *((204, 121, 167), (213, 94, 0), (0, 114, 178), (255, 255, 255)),
)
_DIM = 0.35
"""Brightness of what matches nothing."""
_FONT, _FONT_SIZE, _FONT_WIDTH = cv2.FONT_HERSHEY_SIMPLEX, 0.7, 2
_PAD = 5
_OUTLINE, _HALO = 3, 7

Drawing = npt.NDArray[np.uint8]


def write_drawn(path: str | Path, picture: Picture, blocks: Iterable[Block]) -> None:
    """Write what `drawn` draws.

    Raises:
        PictureError: if the file can't be written.
    """
    _write(path, drawn(picture, blocks))


def drawn(picture: Picture, blocks: Iterable[Block]) -> Drawing:
    """Return the picture, three times as large, with the blocks' outlines, signatures and indices."""
    image = _enlarged(picture)
    listed = list(blocks)
    for block in listed:
        left, top, right, bottom = _corners(block)
        cv2.rectangle(image, (left, top), (right, bottom), (0, 0, 0), _HALO)
        cv2.rectangle(image, (left, top), (right, bottom), _colour(block.signature), _OUTLINE)
    for block in listed:  # last, so that no outline crosses a label
        left, top, _, bottom = _corners(block)
        _label(image, f"s={block.signature:o} i={block.index}", left, top, bottom, _colour(block.signature))
    return image


def write_mask(path: str | Path, picture: Picture, matched: npt.NDArray[np.uint8]) -> None:
    """Write the picture in dim grey, three times as large, and the pixels that match a signature in its colour.

    Args:
        path: the file.
        picture: RGB, shape (208, 316, 3).
        matched: number of the signature of each pixel, 0 for none, shape (208, 316).

    Raises:
        PictureError: if the file can't be written.
    """
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    shown = np.repeat((_DIM * grey).astype(np.uint8)[:, :, None], 3, axis=2)
    for number in range(1, SIGNATURES + 1):
        shown[matched == number] = _colour(number)
    image = _enlarged(shown)
    bottom = image.shape[0] - _PAD
    left = _PAD
    for number in np.unique(matched[matched > 0]).tolist():
        share = 100.0 * np.count_nonzero(matched == number) / matched.size
        left = _label(image, f"s={number} {share:.1f} %", left, bottom, bottom, _colour(number)) + _PAD
    _write(path, image)


def _enlarged(picture: Picture) -> Drawing:
    large = cv2.resize(picture, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST)
    return np.ascontiguousarray(large, np.uint8)


def _colour(signature: int) -> tuple[int, int, int]:
    """Colour of a signature; codes, whose numbers have several digits, are white."""
    return _COLOURS[signature - 1] if 1 <= signature <= SIGNATURES else _COLOURS[-1]


def _corners(block: Block) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of a block in the drawing."""
    left = (block.x - block.width // 2) * SCALE
    top = (block.y - block.height // 2) * SCALE
    return left, top, left + block.width * SCALE, top + (block.height + 1) * SCALE


def _label(image: Drawing, text: str, left: int, top: int, bottom: int, colour: tuple[int, int, int]) -> int:
    """Write on black above a box, or below it where there is no room; return the label's right end."""
    (width, height), below = cv2.getTextSize(text, _FONT, _FONT_SIZE, _FONT_WIDTH)
    rows, columns = image.shape[:2]
    tall, wide = height + below + 2 * _PAD, width + 2 * _PAD
    y = top - tall if top >= tall else min(bottom, rows - tall)
    x = max(0, min(left, columns - wide))
    cv2.rectangle(image, (x, y), (x + wide, y + tall), (0, 0, 0), -1)
    cv2.putText(image, text, (x + _PAD, y + _PAD + height), _FONT, _FONT_SIZE, colour, _FONT_WIDTH, cv2.LINE_AA)
    return int(x + wide)


def _write(path: str | Path, image: Drawing) -> None:
    content = cv2.imencode(".png", np.ascontiguousarray(image[:, :, ::-1]))[1]
    try:
        Path(path).write_bytes(content.tobytes())
    except OSError as error:
        raise PictureError(f"{path}: can't be written ({error.strerror}); choose another place") from error
