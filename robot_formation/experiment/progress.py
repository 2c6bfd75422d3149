"""What a person sees while a run goes on: one line per timestep, from the run's own messages."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from robot_formation import conversions, names
from robot_formation.control.alignment_state import AlignmentState
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion

_SAME_M = 1e-6


@dataclass
class _Heard:
    """What was heard of a robot: stamps [ns] with poses, finished moves, and timesteps not yet told."""

    poses: list[tuple[int, Motion]] = field(default_factory=list)
    moves: list[tuple[int, Motion]] = field(default_factory=list)
    timesteps: deque[tuple[int, Motion]] = field(default_factory=deque)
    told: int = 0
    begun: int = 0
    told_until_ns: int = -1

    def pose_between(self, after_ns: int, until_ns: int) -> Motion | None:
        """Return the last pose stamped in (after, until]."""
        found = [pose for stamp, pose in self.poses if after_ns < stamp <= until_ns]
        return found[-1] if found else None


class Progress:
    """Follows the messages of a run. Feed it absolute topic names with their messages.

    Topics may come in any order, as they do over the middleware: a timestep is told once everything that belongs to it
    has arrived, which the stamps and the sum of its moves tell.
    """

    def __init__(
        self, followers: int, timesteps: int, say: Callable[[str], None], elapsed: Callable[[], float]
    ) -> None:
        self._timesteps = timesteps
        self._say = say
        self._elapsed = elapsed
        robots = [names.LEADER, *(names.follower(n) for n in range(1, followers + 1))]
        self._heard = {robot: _Heard() for robot in robots}
        self._handlers: dict[str, Callable[[Any], None]] = {}
        for robot in robots:
            self._handlers[f"/{names.ground_truth_pose(robot).name}"] = partial(self._pose, robot)
        for robot in robots[1:]:
            self._handlers[f"/{robot}/{names.MOVED.name}"] = partial(self._moved, robot)
            self._handlers[f"/{robot}/{names.ALIGNMENT.name}"] = partial(self._alignment, robot)
            self._handlers[f"/{robot}/{names.DISPLACEMENT.name}"] = partial(self._displacement, robot)

    @property
    def topics(self) -> list[str]:
        """The topics that it wants to hear."""
        return list(self._handlers)

    def listen(self, topic: str, message: Any) -> None:
        """Take a message; others than those of `topics` are ignored."""
        handler = self._handlers.get(topic)
        if handler is not None:
            handler(message)
            self._tell()

    def _pose(self, robot: str, message: Any) -> None:
        self._heard[robot].poses.append((conversions.stamp_of(message), conversions.read_pose(message.pose)))

    def _moved(self, robot: str, message: Any) -> None:
        self._heard[robot].moves.append((conversions.stamp_of(message), conversions.read_displacement(message)))

    def _displacement(self, robot: str, message: Any) -> None:
        self._heard[robot].timesteps.append((conversions.stamp_of(message), conversions.read_displacement(message)))

    def _alignment(self, robot: str, message: Any) -> None:
        state = AlignmentState.parse(message.data)
        if state is None:
            return
        if state.opens_timestep:
            self._heard[robot].begun += 1
        elif state is AlignmentState.LOST:
            self._say(f"{robot}: lost its beacon neighbour in timestep {self._heard[robot].begun}")

    def _tell(self) -> None:
        for robot, heard in self._heard.items():
            while heard.timesteps and self._tell_next(robot, heard):
                heard.timesteps.popleft()

    def _tell_next(self, robot: str, heard: _Heard) -> bool:
        """Say the robot's next timestep if everything of it has arrived."""
        stamp_ns, displacement = heard.timesteps[0]
        neighbour = self._heard[names.beacon_neighbour(robot)]
        own_pose = heard.pose_between(heard.told_until_ns, stamp_ns)
        # The first timestep's moves follow those of the initial alignment, which end before the neighbour's first move.
        place = neighbour.pose_between(max(heard.told_until_ns, 0), stamp_ns)
        if own_pose is None or place is None:
            return False
        moves = [move for stamp, move in heard.moves if heard.told_until_ns < stamp <= stamp_ns]
        corrections = _after_first(moves, displacement)
        if corrections is None:
            return False
        heard.told += 1
        heard.told_until_ns = stamp_ns
        self._say_line(robot, heard.told, corrections, own_pose, place)
        return True

    def _say_line(self, robot: str, timestep: int, corrections: list[Motion], own: Motion, neighbour: Motion) -> None:
        correction_m = sum(abs(move.x_m) + abs(move.y_m) for move in corrections)
        place = neighbour.then(Motion(y_m=-FORMATION_DISTANCE_M))
        error_m = math.hypot(own.x_m - place.x_m, own.y_m - place.y_m)
        who = f"{robot}  " if len(self._heard) > 2 else ""
        self._say(
            f"{who}timestep {timestep:2d}/{self._timesteps}  correction {correction_m * 100:5.1f} cm  "
            f"formation error {error_m * 100:5.2f} cm  {self._elapsed():6.1f} s"
        )


def _after_first(moves: list[Motion], displacement: Motion) -> list[Motion] | None:
    """Of the last moves that compose to the displacement return all but the first, which is the prediction move.

    None if no such moves have arrived.
    """
    for first in range(len(moves) - 1, -1, -1):
        total = Motion()
        for move in moves[first:]:
            total = total.then(move)
        if math.hypot(total.x_m - displacement.x_m, total.y_m - displacement.y_m) < _SAME_M:
            return moves[first + 1 :]
    return None
