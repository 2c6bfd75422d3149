"""What the rest of the package needs to know of a leader's path."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import Choice

Point = tuple[float, float]

_ORIGIN = Motion()


@runtime_checkable
class LeaderPath(Protocol):
    """The leader's motion of every timestep: a pure function of the timestep, the parameters and the seed."""

    @property
    def name(self) -> str:
        """Name in the registry."""

    @property
    def timesteps(self) -> int | None:
        """How many timesteps it has; None: any number."""

    def motion(self, timestep: int) -> Motion:
        """Motion of a timestep (from 1) in the leader's frame at its start: x forward, y left [m], yaw [rad]."""


@dataclass(frozen=True)
class Room:
    """How far the leader's origin may go from its start, along the axes of base_link there, metres."""

    ahead_m: float = math.inf
    behind_m: float = math.inf
    left_m: float = math.inf
    right_m: float = math.inf


@dataclass(frozen=True)
class Given:
    """What a path is told beside its own parameters.

    Attributes:
        step_m: displacement per timestep where the path's own `step_m` isn't set, metres.
        seed: of the random streams.
        room: how far the leader may go.
    """

    step_m: float = 0.05
    seed: int = 0
    room: Room = Room()

    def random(self, source: str) -> np.random.Generator:
        """Make the random stream of the leader's path that is called `source`."""
        return np.random.default_rng(
            np.random.SeedSequence([self.seed, zlib.crc32(b"leader"), zlib.crc32(f"path {source}".encode())])
        )


class PathKind:
    """Base of the families of paths: frozen dataclasses of parameters, which are or make a path.

    A field `step_m` that isn't set gets the leader's; a field `phase` that isn't set is drawn from the seed.
    """

    name: ClassVar[str]
    timesteps: int | None = None

    def prepared(self, given: Given) -> LeaderPath:
        """Return the path, made of these parameters and of the step, seed and room that are given beside them.

        Raises:
            ParameterError: if no path can be made of them.
        """
        return self

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        raise NotImplementedError


class Heading(Choice):
    """Where the leader looks: always where it did at the start, or along its path."""

    KEPT = "kept"
    ALONG = "along"


class Direction(Choice):
    """To which side a path bends."""

    LEFT = "left"
    RIGHT = "right"

    @property
    def sign(self) -> float:
        """1 for anticlockwise, -1 for clockwise."""
        return 1.0 if self is Direction.LEFT else -1.0


class Curve(PathKind):
    """Base of paths that are curves in the plane; timestep t leads from the point at t - 1 to the point at t."""

    heading: Heading

    def point(self, time: float) -> Point:
        """Place after `time` timesteps: x and y in any fixed frame whose x axis points ahead at the start, metres."""
        raise NotImplementedError

    def tangent(self, time: float) -> float:
        """Direction of the curve after `time` timesteps, in the same frame, radians; with no jumps but whole turns."""
        raise NotImplementedError

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        before, after = self._pose(timestep - 1), self._pose(timestep)
        step = after.relative_to(before)
        return Motion(step.x_m, step.y_m, math.remainder(step.yaw_rad, 2.0 * math.pi))

    def _pose(self, time: float) -> Motion:
        heading = self.tangent(time) if self.heading is Heading.ALONG else 0.0
        return Motion(*self.point(time), heading)


def poses(path: LeaderPath, timesteps: int, start: Motion = _ORIGIN) -> list[Motion]:
    """List the leader's poses from its start to the end of the last timestep, timesteps + 1 of them."""
    found = [start]
    for timestep in range(1, timesteps + 1):
        found.append(found[-1].then(path.motion(timestep)))
    return found
