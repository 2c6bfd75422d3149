"""Straight ahead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import PathKind
from robot_formation.parameters import parameter

STEP = parameter(0.05, "displacement per timestep; not given: the leader's step_m", unit="m", low=0.001, high=0.2)


@dataclass(frozen=True)
class Straight(PathKind):
    """Straight ahead, the same step in every timestep (the paper's tracks)."""

    name: ClassVar[str] = "straight"
    step_m: float = STEP

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        return Motion(x_m=self.step_m)
