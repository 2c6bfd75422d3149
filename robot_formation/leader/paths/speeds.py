"""Straight ahead at a speed that changes as in tests of adaptive cruise control: a step, a stop, a sweep of periods."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import PathKind
from robot_formation.leader.paths.straight import STEP
from robot_formation.parameters import parameter

BEFORE = parameter(10, "timesteps before the change", low=0, high=100000)


@dataclass(frozen=True)
class SpeedStep(PathKind):
    """Straight ahead; from one timestep on the steps are longer or shorter."""

    name: ClassVar[str] = "speed_step"
    step_m: float = STEP
    amplitude_m: float = parameter(-0.02, "added to the step after the change", unit="m", low=-0.2, high=0.2)
    before: int = BEFORE

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        return Motion(self.step_m + (self.amplitude_m if timestep > self.before else 0.0))


@dataclass(frozen=True)
class Stop(PathKind):
    """Straight ahead, then a stand for some timesteps, then on."""

    name: ClassVar[str] = "stop"
    step_m: float = STEP
    before: int = BEFORE
    standing: int = parameter(5, "timesteps of the stand", low=1, high=100000)

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        stands = self.before < timestep <= self.before + self.standing
        return Motion(0.0 if stands else self.step_m)


@dataclass(frozen=True)
class Chirp(PathKind):
    """Straight ahead with steps that grow and shrink by a cosine, whose frequency changes evenly."""

    name: ClassVar[str] = "chirp"
    step_m: float = STEP
    amplitude_m: float = parameter(0.02, "of the cosine that is added to the step", unit="m", low=-0.2, high=0.2)
    period: float = parameter(20.0, "timesteps per period at the start", low=2.0, high=1e6)
    last_period: float = parameter(4.0, "timesteps per period after the sweep", low=2.0, high=1e6)
    sweep: int = parameter(40, "timesteps of the sweep", low=1, high=100000)
    phase: float = parameter(
        0.0, "where in the period timestep 1 begins; not given: by the seed", unit="turns", low=-1, high=1
    )

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        return Motion(self.step_m + self.amplitude_m * math.cos(2.0 * math.pi * self._turns(timestep - 1)))

    def _turns(self, time: int) -> float:
        """Turns of the cosine after `time` timesteps: the integral of its frequency."""
        first, last = 1.0 / self.period, 1.0 / self.last_period
        swept = min(time, self.sweep)
        return self.phase + first * swept + 0.5 * (last - first) * swept**2 / self.sweep + last * (time - swept)
