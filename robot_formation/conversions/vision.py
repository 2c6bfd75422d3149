"""Pictures, camera calibrations and blocks."""

from __future__ import annotations

import array
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField

from robot_formation.conversions.basics import MessageError, header
from robot_formation.vision.luminance import LUMINANCE_WEIGHTS
from robot_formation.vision.pixy2.block import Block

# One point per block. x, y, width and height are pixels, angle degrees, index and age counts (Pixy2 getBlocks record).
BLOCK_DTYPE = np.dtype(
    [
        ("signature", "<u2"),
        ("x", "<u2"),
        ("y", "<u2"),
        ("width", "<u2"),
        ("height", "<u2"),
        ("angle", "<i2"),
        ("index", "u1"),
        ("age", "u1"),
    ]
)
_POINT_FIELD_TYPES = {"<u2": PointField.UINT16, "<i2": PointField.INT16, "|u1": PointField.UINT8}


def image(pixels: NDArray[np.uint8], frame: str, stamp_ns: int) -> Image:
    """Make an rgb8 image from (height, width, 3), a mono8 one from (height, width)."""
    height, width = pixels.shape[:2]
    encoding, channels = ("mono8", 1) if pixels.ndim == 2 else ("rgb8", 3)
    message = Image(header=header(stamp_ns, frame), height=height, width=width, encoding=encoding)
    message.step = channels * width
    # Assigning an array('B') is checked in 0.1 ms, a list in 4 ms.
    message.data = array.array("B", pixels.tobytes())
    return message


def read_image(message: Image) -> NDArray[np.uint8]:
    """Read an rgb8 or bgr8 image, padded rows included, as RGB (height, width, 3)."""
    if message.encoding not in ("rgb8", "bgr8"):
        encoding = f"{message.encoding!r:.40}"
        raise MessageError(f"image encoding {encoding} has no colour to find blocks by; send rgb8 or bgr8")
    pixels = _rows(message, 3)
    return pixels[:, :, ::-1] if message.encoding == "bgr8" else pixels


def read_grey_image(message: Image) -> NDArray[np.uint8]:
    """Read a mono8, rgb8 or bgr8 image, padded rows included, as grey levels (height, width)."""
    if message.encoding == "mono8":
        return _rows(message, 1)[:, :, 0]
    if message.encoding not in ("rgb8", "bgr8"):
        raise MessageError(f"image encoding {message.encoding!r:.40} can't be read; send mono8, rgb8 or bgr8")
    return np.asarray(np.rint(read_image(message) @ LUMINANCE_WEIGHTS), np.uint8)


def _rows(message: Image, channels: int) -> NDArray[np.uint8]:
    height, width, step = int(message.height), int(message.width), int(message.step)
    if height < 1 or width < 1 or step < channels * width or len(message.data) != step * height:
        raise MessageError(
            f"image of {width} x {height}, step {step}, has {len(message.data)} bytes: cut off or mis-sized"
        )
    rows = np.frombuffer(message.data, dtype=np.uint8).reshape(height, step)
    return rows[:, : channels * width].reshape(height, width, channels)


def camera_info(
    width: int,
    height: int,
    focal_px: float,
    centre_px: tuple[float, float],
    frame: str,
    stamp_ns: int,
    distortion: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0),
) -> CameraInfo:
    """Make a camera's calibration; distortion is k1, k2, p1, p2, k3 of OpenCV's model."""
    cx, cy = centre_px
    message = CameraInfo(header=header(stamp_ns, frame), height=height, width=width, distortion_model="plumb_bob")
    message.d = list(distortion)
    message.k = [focal_px, 0.0, cx, 0.0, focal_px, cy, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [focal_px, 0.0, cx, 0.0, 0.0, focal_px, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


@lru_cache(maxsize=1)
def _block_fields() -> list[PointField]:
    fields = []
    for name in BLOCK_DTYPE.names or ():
        dtype, offset = BLOCK_DTYPE.fields[name][:2]  # type: ignore[index]
        fields.append(PointField(name=name, offset=offset, datatype=_POINT_FIELD_TYPES[dtype.str], count=1))
    return fields


def blocks(found: Sequence[Block], frame: str, stamp_ns: int) -> PointCloud2:
    """Make one point per block, in the image's frame and with its stamp; also when there is none."""
    rows = [(b.signature, b.x, b.y, b.width, b.height, b.angle, b.index, b.age) for b in found]
    size = BLOCK_DTYPE.itemsize
    return PointCloud2(
        header=header(stamp_ns, frame),
        height=1,
        width=len(rows),
        fields=_block_fields(),
        is_bigendian=False,
        point_step=size,
        row_step=size * len(rows),
        data=array.array("B", np.array(rows, dtype=BLOCK_DTYPE).tobytes()),
        is_dense=True,
    )


def read_blocks(message: PointCloud2) -> list[Block]:
    """Read blocks."""
    if list(message.fields) != _block_fields() or message.point_step != BLOCK_DTYPE.itemsize or message.is_bigendian:
        layout = ", ".join(f"{name} {BLOCK_DTYPE[name].name}" for name in BLOCK_DTYPE.names or ())
        names = ", ".join(field.name for field in message.fields) or "nothing"
        raise MessageError(f"blocks must have the packed little-endian fields {layout}; these have {names}")
    if len(message.data) != message.width * message.height * BLOCK_DTYPE.itemsize:
        raise MessageError(f"blocks of {message.width} points have {len(message.data)} bytes: cut off or mis-sized")
    points = np.frombuffer(message.data, dtype=BLOCK_DTYPE)
    return [Block(*(int(value) for value in point)) for point in points]
