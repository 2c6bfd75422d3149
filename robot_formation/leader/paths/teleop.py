"""A leader driven by a person: velocity commands become one motion per timestep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import PathKind
from robot_formation.parameters import parameter


@dataclass(frozen=True)
class Teleop(PathKind):
    """Driven by a person: the velocities on leader/cmd_vel, held over a timestep's nominal duration."""

    name: ClassVar[str] = "teleop"
    duration_s: float = parameter(1.0, "nominal duration of a timestep", unit="s", low=0.01, high=100.0)
    timeout_s: float = parameter(
        0.5, "dead man's stop: a command older than this stands for standing still", unit="s", low=0.01, high=100.0
    )
    max_forward_m: float = parameter(0.1, "longest step ahead or back", unit="m", low=0.0, high=0.2)
    max_sideways_m: float = parameter(0.05, "longest step to a side", unit="m", low=0.0, high=0.1)
    max_turn_deg: float = parameter(8.0, "largest turn of a timestep", unit="deg", low=0.0, high=60.0)

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`: without a command there is no motion."""
        return Motion()
