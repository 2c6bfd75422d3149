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
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.geometry.slots import Slots, slot
from robot_formation.names import Message
from robot_formation.nodes.host.component_node import qos_profile
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.ros_parameters import ParameterNode, declare
from robot_formation.nodes.host.signals import stopped
from robot_formation.nodes.progress.monitor import topic_of
from robot_formation.parameters import ParameterError, parameter

_IDLE_S = 0.1
_ROUND_S = 0.03
_QUIET_ROUNDS, _MOST_ROUNDS = 4, 60


@dataclass(frozen=True)
class ProgressParameters:
    """What is followed."""

    followers: int = parameter(1, "Number of followers", low=1, high=10)
    timesteps: int = parameter(15, "Timesteps of the run, for the lines", low=1, high=1_000_000)
    slots: tuple[float, ...] = parameter(
        (),
        "Each follower's place, for the formation error: distance to its neighbour's right, offset ahead, one after "
        "another; empty: 0.32 m beside",
        unit="m",
        low=-2.0,
        high=2.0,
    )
    delayed: bool = parameter(False, "Whether places are those of one timestep earlier, for the formation error")

    def __post_init__(self) -> None:
        """Check that each follower has a place."""
        if len(self.slots) not in (0, 2 * self.followers):
            raise ParameterError(
                f"progress: 'slots' has {len(self.slots)} numbers, not two for each of {self.followers} followers"
            )

    def places(self) -> Slots:
        """List the followers' places, each in its neighbour's frame."""
        pairs = zip(self.slots[::2], self.slots[1::2], strict=True)
        return [slot(*pair) for pair in pairs] or [slot(FORMATION_DISTANCE_M)] * self.followers


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
