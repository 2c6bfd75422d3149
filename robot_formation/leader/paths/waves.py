"""Ways forward with a wave: sideways (slalom), or in the length of the steps (pulse)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import Curve, Heading, PathKind, Point
from robot_formation.leader.paths.straight import STEP
from robot_formation.parameters import parameter

AMPLITUDE = "amplitude_m times the cosine of 2 pi ((t - 1) / period + phase)"
PHASE = parameter(0.0, "where in the period timestep 1 begins; not given: by the seed", unit="turns", low=-1, high=1)


@dataclass(frozen=True)
class Slalom(Curve):
    """Forward by step_m and sideways by a cosine in every timestep."""

    name: ClassVar[str] = "slalom"
    step_m: float = STEP
    amplitude_m: float = parameter(0.03, f"sideways per timestep: {AMPLITUDE}", unit="m", low=-0.2, high=0.2)
    period: float = parameter(12.0, "timesteps per period", low=2.0, high=1e6)
    phase: float = PHASE
    heading: Heading = parameter(Heading.KEPT, "where the leader looks")

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        if self.heading is Heading.ALONG:
            return super().motion(timestep)
        return Motion(self.step_m, self.amplitude_m * math.cos(self._angle(timestep - 1.0)))

    def point(self, time: float) -> Point:
        """See `Curve`: the sine whose differences over a timestep are the cosine asked for."""
        height_m = self.amplitude_m / (2.0 * math.sin(math.pi / self.period))
        return self.step_m * time, height_m * math.sin(self._angle(time - 0.5))

    def tangent(self, time: float) -> float:
        """See `Curve`."""
        half = math.pi / self.period
        slope_m = self.amplitude_m * half / math.sin(half) * math.cos(self._angle(time - 0.5))
        return math.atan2(slope_m, self.step_m)

    def _angle(self, time: float) -> float:
        return 2.0 * math.pi * (time / self.period + self.phase)


@dataclass(frozen=True)
class Pulse(PathKind):
    """Straight ahead with steps that grow and shrink by a cosine."""

    name: ClassVar[str] = "pulse"
    step_m: float = STEP
    amplitude_m: float = parameter(0.02, f"added to the step: {AMPLITUDE}", unit="m", low=-0.2, high=0.2)
    period: float = parameter(12.0, "timesteps per period", low=2.0, high=1e6)
    phase: float = PHASE

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        angle = 2.0 * math.pi * ((timestep - 1) / self.period + self.phase)
        return Motion(self.step_m + self.amplitude_m * math.cos(angle))
