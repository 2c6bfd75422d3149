"""What a person sees while a run goes on: one line per timestep, from the run's own messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from robot_formation import conversions, names
from robot_formation.control.motion import Motion
from robot_formation.experiment.scenario import FORMATION_DISTANCE_M


class Progress:
    """Follows the messages of a run. Feed it absolute topic names with their messages, in the order they come."""

    def __init__(
        self, followers: int, timesteps: int, say: Callable[[str], None], elapsed: Callable[[], float]
    ) -> None:
        self._timesteps = timesteps
        self._say = say
        self._elapsed = elapsed
        self._poses: dict[str, Motion] = {}
        self._moves: dict[str, list[Motion]] = {}
        self._finished: dict[str, int] = {}
        self._handlers: dict[str, Callable[[Any], None]] = {}
        robots = [names.LEADER, *(names.follower(n) for n in range(1, followers + 1))]
        for robot in robots:
            self._handlers[f"/{names.ground_truth_pose(robot).name}"] = self._pose(robot)
        for robot in robots[1:]:
            self._moves[robot] = []
            self._handlers[f"/{robot}/{names.MOVED.name}"] = self._moved(robot)
            self._handlers[f"/{robot}/{names.ALIGNMENT.name}"] = self._alignment(robot)
            self._handlers[f"/{robot}/{names.DISPLACEMENT.name}"] = self._displacement(robot)

    @property
    def topics(self) -> list[str]:
        """The topics that it wants to hear."""
        return list(self._handlers)

    @property
    def started(self) -> bool:
        """Whether any robot has begun."""
        return bool(self._poses)

    def listen(self, topic: str, message: Any) -> None:
        """Take a message; others than those of `topics` are ignored."""
        handler = self._handlers.get(topic)
        if handler is not None:
            handler(message)

    def _pose(self, robot: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            self._poses[robot] = conversions.read_pose(message.pose)

        return take

    def _moved(self, robot: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            self._moves[robot].append(conversions.read_displacement(message))

        return take

    def _alignment(self, robot: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            if message.data == "lost":
                self._say(f"{robot}: lost its beacon neighbour in timestep {self._finished.get(robot, 0) + 1}")
            elif message.data in ("collect", "predict"):
                self._moves[robot].clear()  # what was moved before is the initial alignment or an earlier timestep

        return take

    def _displacement(self, robot: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            timestep = self._finished[robot] = self._finished.get(robot, 0) + 1
            corrections = self._moves[robot][1:]
            correction = sum(abs(move.x_m) + abs(move.y_m) for move in corrections)
            self._moves[robot].clear()
            who = f"{robot}  " if len(self._moves) > 1 else ""
            self._say(
                f"{who}timestep {timestep:2d}/{self._timesteps}  correction {correction * 100:5.1f} cm  "
                f"formation error {self._error(robot)}  {self._elapsed():6.1f} s"
            )

        return take

    def _error(self, robot: str) -> str:
        own, neighbour = self._poses.get(robot), self._poses.get(names.beacon_neighbour(robot))
        if own is None or neighbour is None:
            return "    ? cm"
        place = neighbour.then(Motion(y_m=-FORMATION_DISTANCE_M))
        return f"{math.hypot(own.x_m - place.x_m, own.y_m - place.y_m) * 100:5.2f} cm"
