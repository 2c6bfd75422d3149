"""Two straights and two half circles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.leader.paths.base import Curve, Direction, Heading, Point
from robot_formation.leader.paths.straight import STEP
from robot_formation.parameters import parameter


@dataclass(frozen=True)
class Stadium(Curve):
    """Laps of two straights and two half circles; step_m is measured along the path."""

    name: ClassVar[str] = "stadium"
    step_m: float = STEP
    length_m: float = parameter(0.3, "length of each straight", unit="m", low=0.0, high=100.0)
    radius_m: float = parameter(0.4, "radius of the half circles", unit="m", low=0.01, high=100.0)
    heading: Heading = parameter(Heading.ALONG, "where the leader looks")
    direction: Direction = parameter(Direction.RIGHT, "to which side it bends")
    phase: float = parameter(
        0.0,
        "where in the lap timestep 1 begins, from a straight's start; not given: by the seed",
        unit="turns",
        low=-1.0,
        high=1.0,
    )

    @property
    def lap_m(self) -> float:
        """Length of a lap, metres."""
        return 2.0 * (self.length_m + math.pi * self.radius_m)

    def point(self, time: float) -> Point:
        """See `Curve`."""
        half, on_straight_m, angle = self._place(time)
        x_m = on_straight_m + self.radius_m * math.sin(angle)
        y_m = self.radius_m * (1.0 - math.cos(angle))
        if half % 2:  # the way back: the first half, turned by 180 degrees
            x_m, y_m = self.length_m - x_m, 2.0 * self.radius_m - y_m
        return x_m, self.direction.sign * y_m

    def tangent(self, time: float) -> float:
        """See `Curve`."""
        half, _, angle = self._place(time)
        return self.direction.sign * (half * math.pi + angle)

    def _place(self, time: float) -> tuple[int, float, float]:
        """Half laps driven, way on the present straight [m], and angle of the present half circle [rad]."""
        driven_m = self.step_m * time + self.phase * self.lap_m
        half, rest_m = divmod(driven_m, 0.5 * self.lap_m)
        return int(half), min(rest_m, self.length_m), max(rest_m - self.length_m, 0.0) / self.radius_m
