"""The field of view of a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_formation.names import Message


@dataclass(frozen=True)
class Lens:
    """A camera's field of view from top to bottom, radians, and its picture's width over its height."""

    fov_rad: float
    aspect: float


def read_lens(message: Message) -> Lens | None:
    """Read sensor_msgs/CameraInfo; None for a camera without a focal length or a size."""
    width, height, focal_px = float(message.width), float(message.height), float(message.k[4])
    if not (width > 0.0 and height > 0.0 and 0.0 < focal_px < math.inf):
        return None
    return Lens(2.0 * math.atan2(0.5 * height, focal_px), width / height)
