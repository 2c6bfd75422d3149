"""Closed figures that cross themselves: Gerono's lemniscate and Lissajous figures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.leader.paths.base import Curve, Heading, Point
from robot_formation.leader.paths.waves import PHASE
from robot_formation.parameters import ParameterError, parameter


@dataclass(frozen=True)
class Lemniscate(Curve):
    """Gerono's lemniscate: x = a sin(s), y = a sin(s) cos(s) with s = 2 pi (t / period + phase) and a = amplitude_m."""

    name: ClassVar[str] = "lemniscate"
    amplitude_m: float = parameter(0.3, "half of its length", unit="m", low=0.0, high=10.0)
    period: float = parameter(36.0, "timesteps per period", low=2.0, high=1e6)
    phase: float = PHASE
    heading: Heading = parameter(Heading.KEPT, "where the leader looks")

    def point(self, time: float) -> Point:
        """See `Curve`."""
        angle = 2.0 * math.pi * (time / self.period + self.phase)
        sine = math.sin(angle)
        return self.amplitude_m * sine, self.amplitude_m * sine * math.cos(angle)

    def tangent(self, time: float) -> float:
        """See `Curve`."""
        angle = 2.0 * math.pi * (time / self.period + self.phase)
        return math.atan2(math.cos(2.0 * angle), math.cos(angle))


@dataclass(frozen=True)
class Lissajous(Curve):
    """Lissajous figure: x = a sin(p s), y = b sin(q s) with s = 2 pi (t / period + phase)."""

    name: ClassVar[str] = "lissajous"
    amplitude_m: float = parameter(0.3, "a, half of its length", unit="m", low=0.0, high=10.0)
    sideways_m: float = parameter(0.0, "b, half of its width; 0: as amplitude_m", unit="m", low=0.0, high=10.0)
    cycles: int = parameter(3, "p, cycles ahead and back per period", low=1, high=50)
    sideways_cycles: int = parameter(2, "q, cycles sideways per period", low=1, high=50)
    period: float = parameter(60.0, "timesteps per period", low=2.0, high=1e6)
    phase: float = PHASE
    heading: Heading = parameter(Heading.KEPT, "where the leader looks")

    def __post_init__(self) -> None:
        """Check that the curve has a direction everywhere, if the heading follows it."""
        odd = self.cycles * self.sideways_cycles // math.gcd(self.cycles, self.sideways_cycles) ** 2 % 2 == 1
        if self.heading is Heading.ALONG and odd:
            raise ParameterError(
                "path 'lissajous': with these cycles the figure goes back on itself, so that no heading can follow it; "
                "take heading=kept, or one even and one odd number of cycles"
            )

    def point(self, time: float) -> Point:
        """See `Curve`."""
        angle = 2.0 * math.pi * (time / self.period + self.phase)
        side_m = self.sideways_m or self.amplitude_m
        return self.amplitude_m * math.sin(self.cycles * angle), side_m * math.sin(self.sideways_cycles * angle)

    def tangent(self, time: float) -> float:
        """See `Curve`."""
        angle = 2.0 * math.pi * (time / self.period + self.phase)
        side_m = self.sideways_m or self.amplitude_m
        return math.atan2(
            side_m * self.sideways_cycles * math.cos(self.sideways_cycles * angle),
            self.amplitude_m * self.cycles * math.cos(self.cycles * angle),
        )
