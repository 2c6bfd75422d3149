"""Motions and poses in the plane (SE(2)), and the one place where the paper's u and v meet REP-103.

The paper's v is the forward axis, its u the lateral axis, positive to the right. REP-103 has x forward and y left:
v = x and u = -y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

FORMATION_DISTANCE_M = 0.32
"""Distance between base_link origins in formation, along u (paper, with the axes read as side by side): the default of
the fine-tuner's `formation_distance_m`, and the distance at which cameras are calibrated."""


class Legs(NamedTuple):
    """A motion as the drive makes it: the turn first, then along and across the new heading."""

    turn_rad: float
    forward_m: float
    left_m: float


@dataclass(frozen=True)
class Motion:
    """An element of SE(2): x forward [m], y left [m], yaw anticlockwise [rad].

    It stands for a displacement in the frame of `base_link` at its start, or for a pose in a frame that is named.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    @classmethod
    def from_uv(cls, u_m: float, v_m: float) -> Motion:
        """Make a motion from the paper's lateral u (to the right) and forward v, metres."""
        return cls(x_m=v_m, y_m=-u_m)

    @classmethod
    def from_legs(cls, turn_rad: float, forward_m: float, left_m: float) -> Motion:
        """Make the motion of a turn followed by legs along and across the new heading."""
        cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
        return cls(cosine * forward_m - sine * left_m, sine * forward_m + cosine * left_m, turn_rad)

    @property
    def u_m(self) -> float:
        """The paper's lateral component, positive to the right, metres."""
        return -self.y_m

    @property
    def v_m(self) -> float:
        """The paper's forward component, metres."""
        return self.x_m

    @property
    def uv_m(self) -> tuple[float, float]:
        """The paper's components: to the right and forward, metres."""
        return self.u_m, self.v_m

    @property
    def finite(self) -> bool:
        """Whether no component is NaN or infinite."""
        return math.isfinite(self.x_m) and math.isfinite(self.y_m) and math.isfinite(self.yaw_rad)

    @property
    def legs(self) -> Legs:
        """The motion as a turn followed by legs along and across the new heading."""
        return Legs(self.yaw_rad, *into_frame(self.x_m, self.y_m, self.yaw_rad))

    def then(self, other: Motion) -> Motion:
        """Compose: this motion first, then `other` in the frame that this one ends in."""
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Motion(
            self.x_m + cosine * other.x_m - sine * other.y_m,
            self.y_m + sine * other.x_m + cosine * other.y_m,
            self.yaw_rad + other.yaw_rad,
        )

    def inverse(self) -> Motion:
        """Return the motion that leads back."""
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Motion(
            -cosine * self.x_m - sine * self.y_m,
            sine * self.x_m - cosine * self.y_m,
            -self.yaw_rad,
        )

    def relative_to(self, frame: Motion) -> Motion:
        """Return this pose as it is in another one's frame: `frame.inverse().then(self)`, with less rounding."""
        x_m, y_m = into_frame(self.x_m - frame.x_m, self.y_m - frame.y_m, frame.yaw_rad)
        return Motion(x_m, y_m, self.yaw_rad - frame.yaw_rad)


def into_frame(x_m: float, y_m: float, heading_rad: float) -> tuple[float, float]:
    """Components of a vector ahead and to the left of a heading, metres."""
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    return cosine * x_m + sine * y_m, cosine * y_m - sine * x_m


def formation_error_uv_m(follower: Motion, neighbour: Motion, place: Motion) -> tuple[float, float]:
    """Formation error (u, v) in the beacon neighbour's frame, metres, of two poses in the world.

    Zero when the follower's origin lies at its `place` in the neighbour's frame.
    """
    u_m, v_m = follower.relative_to(neighbour).uv_m
    return u_m - place.u_m, v_m - place.v_m
