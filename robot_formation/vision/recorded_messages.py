"""Pictures and blocks out of their messages, whoever read those: ROS, or rosbags out of a bag without ROS."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from robot_formation.errors import MessageError
from robot_formation.names import Message
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
# By the constants of sensor_msgs/PointField.
_POINT_FIELD_TYPES = {"<u2": 4, "<i2": 3, "|u1": 2}


@dataclass(frozen=True)
class BlockField:
    """A field of a block's point, as sensor_msgs/PointField describes it."""

    name: str
    offset: int
    datatype: int
    count: int


BLOCK_FIELDS = tuple(
    BlockField(name, int(BLOCK_DTYPE.fields[name][1]), _POINT_FIELD_TYPES[BLOCK_DTYPE[name].str], 1)  # type: ignore[index]
    for name in BLOCK_DTYPE.names or ()
)
"""The fields of a block's point, in their order."""
_field_values = attrgetter("name", "offset", "datatype", "count")
_BLOCK_FIELD_VALUES = [_field_values(field) for field in BLOCK_FIELDS]


def read_image(message: Message) -> NDArray[np.uint8]:
    """Read an rgb8 or bgr8 image (sensor_msgs/Image), padded rows included, as RGB (height, width, 3).

    Raises:
        MessageError: it has another encoding, or fewer or more bytes than its size needs.
    """
    if message.encoding not in ("rgb8", "bgr8"):
        encoding = f"{message.encoding!r:.40}"
        raise MessageError(f"image encoding {encoding} has no colour to find blocks by; send rgb8 or bgr8")
    pixels = image_rows(message, 3)
    return pixels[:, :, ::-1] if message.encoding == "bgr8" else pixels


def image_rows(message: Message, channels: int) -> NDArray[np.uint8]:
    """Return an image's pixels (height, width, channels), without what pads its rows.

    Raises:
        MessageError: it has fewer or more bytes than its size needs.
    """
    height, width, step = int(message.height), int(message.width), int(message.step)
    if height < 1 or width < 1 or step < channels * width or len(message.data) != step * height:
        raise MessageError(
            f"image of {width} x {height}, step {step}, has {len(message.data)} bytes: cut off or mis-sized"
        )
    rows = np.frombuffer(message.data, dtype=np.uint8).reshape(height, step)
    return rows[:, : channels * width].reshape(height, width, channels)


def read_blocks(message: Message) -> list[Block]:
    """Read blocks (sensor_msgs/PointCloud2, one point each).

    Raises:
        MessageError: its fields are not those of blocks, or it has fewer or more bytes than its points need.
    """
    fields = [_field_values(field) for field in message.fields]
    if fields != _BLOCK_FIELD_VALUES or message.point_step != BLOCK_DTYPE.itemsize or message.is_bigendian:
        layout = ", ".join(f"{name} {BLOCK_DTYPE[name].name}" for name in BLOCK_DTYPE.names or ())
        names = ", ".join(field.name for field in message.fields) or "nothing"
        raise MessageError(f"blocks must have the packed little-endian fields {layout}; these have {names}")
    if len(message.data) != message.width * message.height * BLOCK_DTYPE.itemsize:
        raise MessageError(f"blocks of {message.width} points have {len(message.data)} bytes: cut off or mis-sized")
    points = np.frombuffer(message.data, dtype=BLOCK_DTYPE)
    return [Block(*point) for point in points.tolist()]
