"""A path from a file: poses, poses over time, motions, or the polynomial pieces of crazyswarm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import Given, Heading, LeaderPath, PathKind
from robot_formation.leader.paths.waypoint_file import read_motions
from robot_formation.parameters import Choice, ParameterError, parameter


class AtEnd(Choice):
    """What a path does after its file's last row."""

    STOP = "stop"
    REPEAT = "repeat"


@dataclass(frozen=True)
class Waypoints(PathKind):
    """A CSV file: x_m,y_m[,yaw_rad], the same after t_s, dx_m,dy_m,dyaw_rad, or crazyswarm's polynomials."""

    name: ClassVar[str] = "waypoints"
    file: str = parameter("", "the CSV file; it has to be given")
    step_s: float = parameter(
        1.0, "files with times: how much of the file's time a timestep takes", unit="s", low=1e-3, high=1e6
    )
    scale: float = parameter(1.0, "factor on all lengths", low=1e-6, high=1e6)
    heading: Heading = parameter(
        Heading.KEPT, "files without headings: keep the start's, or look along the way to the next point"
    )
    at_end: AtEnd = parameter(AtEnd.STOP, "after the last row: stop is the end of the path, repeat begins again")

    def prepared(self, given: Given) -> LeaderPath:
        """See `PathKind`: reads the file."""
        if not self.file:
            raise ParameterError("path 'waypoints': name its CSV file, like leader.path_parameters=[file=my_path.csv]")
        motions = read_motions(Path(self.file), self.step_s, self.scale, along=self.heading is Heading.ALONG)
        return FromFile(motions, repeat=self.at_end is AtEnd.REPEAT)


@dataclass(frozen=True)
class FromFile:
    """A path whose motions are listed, once or again and again."""

    motions: Sequence[Motion]
    repeat: bool = False
    name: ClassVar[str] = Waypoints.name

    @property
    def timesteps(self) -> int | None:
        """See `LeaderPath`."""
        return None if self.repeat else len(self.motions)

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`; there is no motion after the last."""
        if self.repeat:
            return self.motions[(timestep - 1) % len(self.motions)]
        return self.motions[timestep - 1] if timestep <= len(self.motions) else Motion()
