"""Reads height maps: square grids of numbers from 16-bit PNG or NPY files, refused with one line if unusable."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.parameters import ParameterError

MIN_SAMPLES = 4
MAX_SAMPLES = 4096
"""Samples per edge; the interpolation needs four."""

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PNG_HEAD = struct.Struct(">8x4x4sIIBB")  # signature, length, "IHDR", width, height, bit depth, colour type
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
        with path.open("rb") as file:
            head = file.read(_PNG_HEAD.size)
        grid = _read_png(path, head) if head.startswith(_PNG_SIGNATURE) else _read_npy(path)
    except OSError as error:
        raise ParameterError(f"height map {path}: can't read it: {error.strerror or error}") from None
    samples = grid / _FULL_SCALE if grid.dtype == np.uint16 else grid.astype(np.float64)
    if not np.isfinite(samples).all():
        raise ParameterError(f"height map {path}: holds numbers that are not finite; fill the gaps first")
    return samples


def _read_png(path: Path, head: bytes) -> NDArray[np.uint16]:
    if len(head) < _PNG_HEAD.size:
        raise ParameterError(f"height map {path}: the PNG file is cut off; export it again")
    _, width, height, depth, colour = _PNG_HEAD.unpack(head)
    # Read before decoding: a small file can claim to be a huge picture.
    _check_shape(path, (height, width))
    if (depth, colour) != (16, 0):
        raise ParameterError(
            f"height map {path}: the PNG has {depth} bits and colour type {colour}; "
            "save it as 16-bit greyscale (8 bits would be steps, not slopes)"
        )
    content = path.read_bytes()
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if _is_whole(content) else None
    if picture is None or picture.shape != (height, width) or picture.dtype != np.uint16:
        raise ParameterError(f"height map {path}: the PNG file is damaged; export it again")
    return np.asarray(picture[::-1], np.uint16)


def _is_whole(png: bytes) -> bool:
    """Whether all chunks are there and have their check sums; OpenCV would fill what is missing with black."""
    at = len(_PNG_SIGNATURE)
    while len(png) >= at + 12:
        length = int.from_bytes(png[at : at + 4], "big")
        kind, end = png[at + 4 : at + 8], at + 8 + length
        if zlib.crc32(png[at + 4 : end]) != int.from_bytes(png[end : end + 4], "big"):
            return False
        if kind == b"IEND":
            return True
        at = end + 4
    return False


def _read_npy(path: Path) -> NDArray[np.uint16] | NDArray[np.float64]:
    try:
        # Mapped, not read: the header tells the size, and a cut-off file is noticed.
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError) as error:
        reason = " ".join(str(error).split()) or "it is empty"
        raise ParameterError(f"height map {path}: neither a PNG nor a usable NPY file ({reason})") from None
    if not isinstance(mapped, np.ndarray):
        raise ParameterError(f"height map {path}: an NPZ archive; save one array with numpy.save instead")
    _check_shape(path, mapped.shape)
    if mapped.dtype not in (np.dtype(np.uint16), np.dtype(np.float32), np.dtype(np.float64)):
        raise ParameterError(f"height map {path}: holds {mapped.dtype} numbers; save it as uint16, float32 or float64")
    return np.array(mapped)


def _check_shape(path: Path, shape: tuple[int, ...]) -> None:
    said = " x ".join(map(str, shape))
    if len(shape) != 2 or shape[0] != shape[1]:
        raise ParameterError(f"height map {path}: the plate is square, the grid of {said or 'one number'} is not")
    if not MIN_SAMPLES <= shape[0] <= MAX_SAMPLES:
        raise ParameterError(f"height map {path}: {said} samples; give {MIN_SAMPLES} to {MAX_SAMPLES} along each edge")
