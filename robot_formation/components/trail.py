"""A robot's path for viewers, bounded in size however long the drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Generic, TypeVar

T = TypeVar("T")

SPACING_M = 0.02
"""Distance between neighbouring poses of a path until it is full, metres: less than a timestep's step."""
MOST_POSES = 512
"""Then every other pose is left out and the distance doubled, so that the whole drive stays visible."""
_SHARE = 32  # a path is sent when a 32nd of it is new: all messages together then grow with the drive, not its square


class Trail(Generic[T]):
    """Collects poses of one robot and says when its path is worth sending."""

    def __init__(self) -> None:
        self._poses: list[T] = []
        self._last: Sequence[float] = ()
        self._spacing_m = SPACING_M
        self._new = 0

    def add(self, place_m: Sequence[float], pose: T) -> list[T] | None:
        """Add a pose; return the path to send, the newest pose at its end, or None if it need not be sent now.

        Args:
            place_m: where the robot is: x, y, z in metres.
            pose: what stands for it in the path.
        """
        if self._poses and math.dist(place_m, self._last) < self._spacing_m:
            return None
        self._last = tuple(place_m)
        self._poses.append(pose)
        self._new += 1
        if len(self._poses) > MOST_POSES:
            self._poses = self._poses[::2]
            self._spacing_m *= 2.0
        if self._new * _SHARE < len(self._poses):
            return None
        self._new = 0
        return list(self._poses)
