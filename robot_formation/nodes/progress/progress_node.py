"""The `progress` executable: the lines of `formation run` for a run that others have started, stand-ins included."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from rclpy.executors import Executor

from robot_formation import conversions, exit_codes, names
from robot_formation.experiment.progress import Progress
from robot_formation.experiment.stand_ins import LONGEST_S, TIMEOUT_S, StandIns, how_to_start
from robot_formation.names import Message
from robot_formation.nodes.followed_run import FollowedRunParameters
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.living_nodes import node_names
from robot_formation.nodes.host.qos import qos_profile
from robot_formation.nodes.host.ros_parameters import ParameterNode, declare
from robot_formation.nodes.host.signals import stopped
from robot_formation.nodes.progress.monitor import topic_of
from robot_formation.parameters import parameter

_IDLE_S = 0.1
_ROUND_S = 0.03
_QUIET_ROUNDS, _MOST_ROUNDS = 4, 60


@dataclass(frozen=True)
class ProgressParameters(FollowedRunParameters):
    """What is followed."""

    stand_ins: tuple[str, ...] = parameter(
        (),
        "Nodes of the run that somebody else starts, like follower_1/block_detector; if relative, in this node's "
        "namespace",
    )
    stand_in_timeout_s: float = parameter(
        TIMEOUT_S, "How long they may take to appear", unit="s", low=0.0, high=LONGEST_S
    )


class ProgressExecutable:
    """Prints one line per timestep and follower on standard output, until a signal comes."""

    fixed: ClassVar[Mapping[str, str]] = {"*": "it decides on topics and lines; start another one"}

    def __init__(self, node: ParameterNode) -> None:
        (parameters,) = declare(node, ProgressParameters, fixed=self.fixed)
        self._node = node
        self._stand_ins = _wait_for(node, parameters)
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
        """Follow the run; return the exit code: NODE_DIED if a stand-in doesn't appear, or goes."""
        executor = make_executor()
        executor.add_node(self._node)
        try:
            while not stopped():
                executor.spin_once(_IDLE_S)
                if self._stand_ins.due and (reason := self._look()):
                    print(reason, file=sys.stderr, flush=True)
                    return exit_codes.NODE_DIED
            self._drain(executor)
        finally:
            executor.shutdown()
        return exit_codes.DONE

    def _look(self) -> str:
        return self._stand_ins.look(node_names(self._node), begun=self._progress.timestep_finished)

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


def _wait_for(node: ParameterNode, parameters: ProgressParameters) -> StandIns:
    """Tell how to start the nodes that somebody else starts, and begin to wait for them."""
    nodes = [names.absolute(node.get_namespace(), name) for name in parameters.stand_ins]
    if nodes:
        for line in how_to_start(nodes, parameters.stand_in_timeout_s):
            _say(line)
    return StandIns(nodes, parameters.stand_in_timeout_s, _say)


def _say(text: str) -> None:
    print(text, flush=True)
