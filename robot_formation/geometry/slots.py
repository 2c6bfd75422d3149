"""Slots: where each follower's place is in its beacon neighbour's frame, and so in the leader's."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robot_formation.geometry.se2 import Motion

Slots = Sequence[Motion]
"""Places of follower 1, 2, ... each in the frame of the robot on its left, without a turn."""


def slot(lateral_m: float, ahead_m: float = 0.0) -> Motion:
    """Return the place so far to the neighbour's right and ahead of it, metres."""
    return Motion(ahead_m, -lateral_m)


def leader_places(slots: Slots) -> tuple[Motion, ...]:
    """Return the places of all robots in the leader's frame, the leader's own first: sums of the slots."""
    return tuple(
        Motion(math.fsum(place.x_m for place in slots[:number]), math.fsum(place.y_m for place in slots[:number]))
        for number in range(len(slots) + 1)
    )
