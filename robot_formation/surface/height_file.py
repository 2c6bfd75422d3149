"""Reads height maps: square grids of numbers from 16-bit PNG or NPY files, refused with one line if unusable."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import ParameterError
from robot_formation.system.files import read_file
from robot_formation.system.png_files import SIGNATURE, is_whole, png_head, unpacks_within

MIN_SAMPLES = 4
MAX_SAMPLES = 4096
"""Samples per edge; the interpolation needs four."""

_MOST_BYTES = MAX_SAMPLES**2 * 8 + (1 << 20)
_FULL_SCALE = 65535.0


def read_heights(path: Path) -> NDArray[np.float64]:
    """Read a height map: shape (n, n), [row, column] along y and x, both ascending; 1.0 is full scale.

    A PNG is a picture seen from above: its top row lies at the largest y. An NPY array is indexed [y, x] from the
    plate's origin. Whole numbers (uint16) count 65535 as full scale, floating-point ones are taken as they are.

    Raises:
        ParameterError: if the file is missing, is no such file, or its grid isn't square, finite and of a size
            between 4 and 4096.
    """
    try:
        content = read_file(path, _MOST_BYTES)
    except OSError as error:
        raise ParameterError(f"height map {path}: can't read it: {error.strerror or error}") from None
    grid = _read_png(path, content) if content.startswith(SIGNATURE) else _read_npy(path, content)
    samples = grid / _FULL_SCALE if grid.dtype == np.uint16 else grid.astype(np.float64)
    if not np.isfinite(samples).all():
        raise ParameterError(f"height map {path}: holds numbers that are not finite; fill the gaps first")
    return samples


def _read_png(path: Path, content: bytes) -> NDArray[np.uint16]:
    head = png_head(content)
    if head is None:
        raise ParameterError(f"height map {path}: the PNG file is cut off; export it again")
    # Read before decoding: a small file can claim to be a huge picture.
    _check_shape(path, (head.height, head.width))
    if (head.depth, head.colour) != (16, 0):
        raise ParameterError(
            f"height map {path}: the PNG has {head.depth} bits and colour type {head.colour}; "
            "save it as 16-bit greyscale (8 bits would be steps, not slopes)"
        )
    import cv2  # not above: who only names a surface needs no OpenCV, which takes 7 MB

    usable = is_whole(content) and unpacks_within(content, head.data_bytes)
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if usable else None
    if picture is None or picture.shape != (head.height, head.width) or picture.dtype != np.uint16:
        raise ParameterError(f"height map {path}: the PNG file is damaged; export it again")
    return np.asarray(picture[::-1], np.uint16)


def _read_npy(path: Path, content: bytes) -> NDArray[np.uint16] | NDArray[np.float64]:
    if content.startswith(b"PK"):
        raise ParameterError(f"height map {path}: an NPZ archive; save one array with numpy.save instead")
    stream = io.BytesIO(content)
    try:
        # The header tells the size before anything is made of it.
        version = np.lib.format.read_magic(stream)
        read_head = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = read_head(stream)
    except Exception as error:  # what NumPy's parser of headers raises has no common base
        reason = " ".join(str(error).split())[:120] or "it is empty"
        raise ParameterError(f"height map {path}: neither a PNG nor a usable NPY file ({reason})") from None
    _check_shape(path, shape)
    if kind not in (np.dtype(np.uint16), np.dtype(np.float32), np.dtype(np.float64)):
        raise ParameterError(f"height map {path}: holds {kind} numbers; save it as uint16, float32 or float64")
    stream.seek(0)
    try:
        return np.array(np.load(stream, allow_pickle=False))
    except (ValueError, EOFError, OSError) as error:
        reason = " ".join(str(error).split())[:120]
        raise ParameterError(f"height map {path}: neither a PNG nor a usable NPY file ({reason})") from None


def _check_shape(path: Path, shape: tuple[int, ...]) -> None:
    said = " x ".join(map(str, shape))
    if len(shape) != 2 or shape[0] != shape[1]:
        raise ParameterError(f"height map {path}: the plate is square, the grid of {said or 'one number'} is not")
    if not MIN_SAMPLES <= shape[0] <= MAX_SAMPLES:
        raise ParameterError(f"height map {path}: {said} samples; give {MIN_SAMPLES} to {MAX_SAMPLES} along each edge")
