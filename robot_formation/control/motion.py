"""Planar displacement of a robot in its own frame, and the one place where the paper's u and v meet REP-103."""

from __future__ import annotations

import math
from dataclasses import dataclass

FORMATION_DISTANCE_M = 0.32
"""Distance between base_link origins in formation, along u (paper, with the axes read as side by side)."""


@dataclass(frozen=True)
class Motion:
    """A displacement in the frame of `base_link` at its start: x forward [m], y left [m], yaw anticlockwise [rad].

    The paper's v is +x and its u is the lateral axis, positive to the right: u = -y.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    @classmethod
    def from_uv(cls, u_m: float, v_m: float) -> Motion:
        """Make a motion from the paper's lateral u (to the right) and forward v, metres."""
        return cls(x_m=v_m, y_m=-u_m)

    @property
    def u_m(self) -> float:
        """The paper's lateral component, positive to the right, metres."""
        return -self.y_m

    @property
    def v_m(self) -> float:
        """The paper's forward component, metres."""
        return self.x_m

    @property
    def finite(self) -> bool:
        """Whether no component is NaN or infinite."""
        return math.isfinite(self.x_m) and math.isfinite(self.y_m) and math.isfinite(self.yaw_rad)

    def then(self, other: Motion) -> Motion:
        """Compose: this motion first, then `other` in the frame that this one ends in."""
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Motion(
            self.x_m + cosine * other.x_m - sine * other.y_m,
            self.y_m + sine * other.x_m + cosine * other.y_m,
            self.yaw_rad + other.yaw_rad,
        )
