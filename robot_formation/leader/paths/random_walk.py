"""A walk whose direction changes at random; it turns back at the edge of the room that it has."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import Given, LeaderPath, PathKind
from robot_formation.leader.paths.straight import STEP
from robot_formation.parameters import ParameterError, parameter


@dataclass(frozen=True)
class RandomWalk(PathKind):
    """Steps of one length, heading kept, in directions that change at random; it turns back at the plate's edge."""

    name: ClassVar[str] = "random_walk"
    step_m: float = STEP
    turn_deg: float = parameter(
        30.0, "standard deviation of the change of direction per timestep", unit="deg", low=0.0, high=180.0
    )
    phase: float = parameter(
        0.0, "direction of the first step; not given: by the seed", unit="turns", low=-1.0, high=1.0
    )

    def prepared(self, given: Given) -> LeaderPath:
        """See `PathKind`."""
        return _Walk(self, given)


class _Walk:
    """A walk in a room; its steps are drawn in order and kept, so that each is asked for at no cost."""

    name = RandomWalk.name
    timesteps: int | None = None

    def __init__(self, parameters: RandomWalk, given: Given) -> None:
        self._step_m = parameters.step_m
        self._sigma = math.radians(parameters.turn_deg)
        self._room = given.room
        self._random = given.random("walk")
        self._direction = 2.0 * math.pi * parameters.phase
        self._x_m = self._y_m = 0.0
        self._steps: list[Motion] = []
        room = given.room
        if min(room.ahead_m + room.behind_m, room.left_m + room.right_m) < 2.0 * self._step_m:
            raise ParameterError(
                f"path 'random_walk': the plate leaves the leader a room of {room.ahead_m + room.behind_m:.2f} x "
                f"{room.left_m + room.right_m:.2f} m, which is too small for steps of {self._step_m:g} m; "
                "take a larger plate (world.surface_parameters size_m) or fewer followers"
            )

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`."""
        while len(self._steps) < timestep:
            self._steps.append(self._next())
        return self._steps[timestep - 1]

    def _next(self) -> Motion:
        self._direction += self._sigma * float(self._random.standard_normal())
        x_m, y_m = self._step_m * math.cos(self._direction), self._step_m * math.sin(self._direction)
        if not -self._room.behind_m <= self._x_m + x_m <= self._room.ahead_m:
            x_m = -x_m
        if not -self._room.right_m <= self._y_m + y_m <= self._room.left_m:
            y_m = -y_m
        self._direction = math.atan2(y_m, x_m)
        self._x_m += x_m
        self._y_m += y_m
        return Motion(x_m, y_m)
