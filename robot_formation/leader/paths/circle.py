"""Circles: with the heading kept, or along the path."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import Direction, Given, Heading, LeaderPath, PathKind
from robot_formation.leader.paths.straight import STEP
from robot_formation.parameters import ParameterError, parameter

_PERIOD = 12.0


@dataclass(frozen=True)
class Circle(PathKind):
    """A circle; the heading is kept, or follows the circle.

    Successive places are step_m apart (chord). Kept: the step of timestep t points at 2 pi ((t - 1) / period + phase).
    Along: the leader turns by 2 pi / period and ends tangential to the circle again.
    """

    name: ClassVar[str] = "circle"
    step_m: float = STEP
    period: float = parameter(
        0.0, f"timesteps per turn; 0: what radius_m makes of it, else {_PERIOD:g}", low=0.0, high=1e6
    )
    radius_m: float = parameter(0.0, "radius, instead of period; 0: by period", unit="m", low=0.0, high=100.0)
    heading: Heading = parameter(Heading.KEPT, "where the leader looks")
    direction: Direction = parameter(Direction.LEFT, "to which side the circle bends")
    phase: float = parameter(
        0.0, "direction of the first step, heading kept; not given: by the seed", unit="turns", low=-1.0, high=1.0
    )

    def __post_init__(self) -> None:
        """Check that period and radius make one circle."""
        if self.period and self.radius_m:
            raise ParameterError(
                "path 'circle': give 'period' or 'radius_m', not both: the step makes one of the other"
            )
        if self.period and self.period < 2.0:
            raise ParameterError(f"path 'circle': 'period' must be 2 or more, not {self.period:g}")
        if self.radius_m and self.radius_m < 0.5 * self.step_m:
            raise ParameterError(
                f"path 'circle': a step of {self.step_m:g} m doesn't fit into a radius of {self.radius_m:g} m; "
                f"the radius must be at least {0.5 * self.step_m:g} m"
            )

    def prepared(self, given: Given) -> LeaderPath:
        """See `PathKind`: without a period and a radius the period is 12."""
        return self if self.period or self.radius_m else replace(self, period=_PERIOD)

    @property
    def turn_rad(self) -> float:
        """Change of direction per timestep, anticlockwise."""
        if self.radius_m:
            return self.direction.sign * 2.0 * math.asin(0.5 * self.step_m / self.radius_m)
        return self.direction.sign * 2.0 * math.pi / (self.period or _PERIOD)

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        if self.heading is Heading.ALONG:
            return arc_step(self.step_m, self.turn_rad)
        angle = (timestep - 1) * self.turn_rad + 2.0 * math.pi * self.phase
        return Motion(self.step_m * math.cos(angle), self.step_m * math.sin(angle))


def arc_step(chord_m: float, turn_rad: float) -> Motion:
    """Return the motion along a piece of a circle that begins and ends tangential: its chord [m] and its turn [rad]."""
    return Motion(chord_m * math.cos(0.5 * turn_rad), chord_m * math.sin(0.5 * turn_rad), turn_rad)
