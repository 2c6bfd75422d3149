"""Pictures, camera calibrations and blocks; they are read by `vision.recorded_messages`."""

from __future__ import annotations

import array
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField

from robot_formation.conversions.basics import stamped
from robot_formation.errors import MessageError
from robot_formation.vision.luminance import LUMINANCE_WEIGHTS
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.recorded_messages import BLOCK_DTYPE, BLOCK_FIELDS, image_rows, read_image


def image(pixels: NDArray[np.uint8], frame: str, stamp_ns: int) -> Image:
    """Make an rgb8 image from (height, width, 3), a mono8 one from (height, width)."""
    height, width = pixels.shape[:2]
    encoding, channels = ("mono8", 1) if pixels.ndim == 2 else ("rgb8", 3)
    message = stamped(Image, stamp_ns, frame, height=height, width=width, encoding=encoding)
    message.step = channels * width
    # Into the message's own array: one that is assigned is copied once more.
    message.data.frombytes(np.ascontiguousarray(pixels).data.cast("B"))
    return message


def read_grey_image(message: Image) -> NDArray[np.uint8]:
    """Read a mono8, rgb8 or bgr8 image, padded rows included, as grey levels (height, width)."""
    if message.encoding == "mono8":
        return image_rows(message, 1)[:, :, 0]
    if message.encoding not in ("rgb8", "bgr8"):
        raise MessageError(f"image encoding {message.encoding!r:.40} can't be read; send mono8, rgb8 or bgr8")
    return np.asarray(np.rint(read_image(message) @ LUMINANCE_WEIGHTS), np.uint8)


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
    message = stamped(CameraInfo, stamp_ns, frame, height=height, width=width, distortion_model="plumb_bob")
    message.d = list(distortion)
    message.k = [focal_px, 0.0, cx, 0.0, focal_px, cy, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [focal_px, 0.0, cx, 0.0, 0.0, focal_px, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


@lru_cache(maxsize=1)
def _block_fields() -> list[PointField]:
    return [PointField(**vars(field)) for field in BLOCK_FIELDS]


def blocks(found: Sequence[Block], frame: str, stamp_ns: int) -> PointCloud2:
    """Make one point per block, in the image's frame and with its stamp; also when there is none."""
    rows = [(b.signature, b.x, b.y, b.width, b.height, b.angle, b.index, b.age) for b in found]
    size = BLOCK_DTYPE.itemsize
    return stamped(
        PointCloud2,
        stamp_ns,
        frame,
        height=1,
        width=len(rows),
        fields=_block_fields(),
        is_bigendian=False,
        point_step=size,
        row_step=size * len(rows),
        data=array.array("B", np.array(rows, dtype=BLOCK_DTYPE).tobytes()),
        is_dense=True,
    )
