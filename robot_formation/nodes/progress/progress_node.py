"""The `progress` executable: the lines of `formation run` for a run that others have started."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from rclpy.executors import Executor

from robot_formation import conversions, exit_codes
from robot_formation.experiment.progress import Progress
from robot_formation.names import Message
from robot_formation.nodes.followed_run import FollowedRunParameters
from robot_formation.nodes.host.component_node import qos_profile
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.ros_parameters import ParameterNode, declare
from robot_formation.nodes.host.signals import stopped
from robot_formation.nodes.progress.monitor import topic_of

_IDLE_S = 0.1
_ROUND_S = 0.03
_QUIET_ROUNDS, _MOST_ROUNDS = 4, 60


@dataclass(frozen=True)
class ProgressParameters(FollowedRunParameters):
    """What is followed."""


class ProgressExecutable:
    """Prints one line per timestep and follower on standard output, until a signal comes."""

    fixed: ClassVar[Mapping[str, str]] = {"*": "it decides on topics and lines; start another one"}

    def __init__(self, node: ParameterNode) -> None:
        (parameters,) = declare(node, ProgressParameters, fixed=self.fixed)
        self._node = node
        self._messages = 0
        began = time.monotonic()
        self._progress = Progress(
            parameters.places(),
            parameters.timesteps,
            _say,
            lambda: time.monotonic() - began,
            delayed=parameters.delayed,
        )
        for name in self._progress.topics:
            topic = topic_of(name)
            message_class, inside = conversions.message_class(topic.type), name.lstrip("/")
            node.create_subscription(message_class, inside, partial(self._take, name), qos_profile(topic.qos))

    def run(self) -> int:
        """Follow the run; return the exit code."""
        executor = make_executor()
        executor.add_node(self._node)
        try:
            while not stopped():
                executor.spin_once(_IDLE_S)
            self._drain(executor)
        finally:
            executor.shutdown()
        return exit_codes.DONE

    def _drain(self, executor: Executor) -> None:
        """Process what is still on its way: the last timestep's messages, mostly."""
        quiet = 0
        for _ in range(_MOST_ROUNDS):
            before = self._messages
            executor.spin_once(_ROUND_S)
            quiet = quiet + 1 if self._messages == before else 0
            if quiet == _QUIET_ROUNDS:
                return

    def _take(self, topic: str, message: Message) -> None:
        self._messages += 1
        self._progress.listen(topic, message)


def _say(text: str) -> None:
    print(text, flush=True)
