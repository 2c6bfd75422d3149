"""A bend between two straights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.leader.paths.base import Curve, Direction, Heading, Point
from robot_formation.leader.paths.straight import STEP
from robot_formation.parameters import parameter


@dataclass(frozen=True)
class Arc(Curve):
    """A straight, an arc of a circle, and a straight again; step_m is measured along the path."""

    name: ClassVar[str] = "arc"
    step_m: float = STEP
    radius_m: float = parameter(0.6, "radius of the arc", unit="m", low=0.01, high=100.0)
    angle_deg: float = parameter(90.0, "angle of the arc, whole turns too", unit="deg", low=0.0, high=1e6)
    before: float = parameter(0.0, "timesteps straight ahead before the arc", low=0.0, high=1e6)
    heading: Heading = parameter(Heading.ALONG, "where the leader looks")
    direction: Direction = parameter(Direction.LEFT, "to which side the arc bends")

    def point(self, time: float) -> Point:
        """See `Curve`."""
        straight_m, arc_m, after_m = self._lengths(time)
        angle = arc_m / self.radius_m
        x_m = straight_m + self.radius_m * math.sin(angle) + after_m * math.cos(angle)
        y_m = self.radius_m * (1.0 - math.cos(angle)) + after_m * math.sin(angle)
        return x_m, self.direction.sign * y_m

    def tangent(self, time: float) -> float:
        """See `Curve`."""
        return self.direction.sign * self._lengths(time)[1] / self.radius_m

    def _lengths(self, time: float) -> tuple[float, float, float]:
        """Lengths driven before, on and after the arc, metres."""
        driven_m, before_m = self.step_m * time, self.step_m * self.before
        whole_m = self.radius_m * math.radians(self.angle_deg)
        on_m = min(max(driven_m - before_m, 0.0), whole_m)
        return min(driven_m, before_m), on_m, max(driven_m - before_m - whole_m, 0.0)
