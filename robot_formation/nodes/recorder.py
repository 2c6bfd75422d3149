"""The `recorder` executable: every topic, raw, into an MCAP bag."""

from __future__ import annotations

import re
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robot_formation import conversions, exit_codes, names
from robot_formation.bag.errors import BagError
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.recorder import Recorder
from robot_formation.nodes.executor import make_executor
from robot_formation.nodes.host import run_node, stopped
from robot_formation.nodes.parameters import HostParameters, declare
from robot_formation.parameters import ParameterError, parameter

_DISCOVERY_S = 0.05
_TICK_TYPE = "std_msgs/msg/UInt32"
_AFTER_TICK_S = 0.01  # what belongs to a timestep arrives well within this after its tick
_IDLE_S = 0.05
_ROUND_S = 0.03
_QUIET_ROUNDS = 4  # without a message after the signal to end: everything sent has arrived
_LONGEST_DRAIN_S = 5.0


@dataclass(frozen=True)
class RecorderParameters:
    """What is recorded and where."""

    path: str = parameter("", "Folder of the bag; it must not exist")
    exclude: str = parameter(
        "/parameter_events|/rosout|.*/transition_event",
        "Regular expression of topics that are left out, matched as a whole",
    )
    images: bool = parameter(False, "Record pictures too: noisy frames are 126 MB per thousand")
    metadata: tuple[str, ...] = parameter((), "Texts 'key=value' for the bag's metadata record")


class RecorderNode:
    """Discovers topics, subscribes raw with their publishers' QoS and writes what arrives."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._parameters: RecorderParameters
        self._parameters, _ = declare(node, RecorderParameters, HostParameters)
        if not self._parameters.path:
            raise ParameterError("recorder: say where the bag goes, with the parameter 'path'")
        try:
            self._exclude = re.compile(self._parameters.exclude)
        except re.error as error:
            raise ParameterError(f"recorder: 'exclude' is no regular expression: {error}") from None
        self._recorder = Recorder(Path(self._parameters.path), dict(t.split("=", 1) for t in self._parameters.metadata))
        self._ignored: set[str] = set()
        self._messages = 0
        self._tick_at: float | None = None

    def run(self) -> int:
        """Record until a signal comes; then take what is still on its way and close the bag."""
        executor = make_executor()
        executor.add_node(self._node)
        timer = self._node.create_timer(_DISCOVERY_S, self._discover, clock=Clock(clock_type=ClockType.STEADY_TIME))
        try:
            while not stopped():
                before = self._messages
                executor.spin_once(_IDLE_S if self._tick_at is None else _AFTER_TICK_S)
                self._end_chunk(idle=self._messages == before)
            timer.cancel()
            self._drain(executor)
            path = self._recorder.close()
        except BagError as error:
            # What was written before stays in the .partial folder.
            print(f"recorder: {error}", file=sys.stderr)
            return exit_codes.ERROR
        finally:
            executor.shutdown()
        self._node.get_logger().info(f"{self._recorder.message_count} messages in {path}")
        return exit_codes.DONE

    def _end_chunk(self, *, idle: bool) -> None:
        """Close a chunk soon after every tick, and whenever nothing arrives."""
        due = self._tick_at is not None and time.monotonic() - self._tick_at > _AFTER_TICK_S
        if idle or due:
            self._tick_at = None
            self._recorder.end_chunk()

    def _drain(self, executor: Executor) -> None:
        end = time.monotonic() + _LONGEST_DRAIN_S
        quiet = 0
        # Rounds are counted, not time: on a busy machine this process may not run for longer than any silence.
        while quiet < _QUIET_ROUNDS and time.monotonic() < end:
            before = self._messages
            executor.spin_once(_ROUND_S)
            quiet = 0 if self._messages != before else quiet + 1

    def _discover(self) -> None:
        for name, types in self._node.get_topic_names_and_types():
            if name in self._recorder.topics or name in self._ignored:
                continue
            infos = self._node.get_publishers_info_by_topic(name)
            if not infos:
                continue
            if self._exclude.fullmatch(name) or (types[0] == names.IMAGE_TYPE and not self._parameters.images):
                self._ignored.add(name)
                continue
            self._subscribe(name, types[0], infos)

    def _subscribe(self, name: str, type_name: str, infos: list[TopicEndpointInfo]) -> None:
        try:
            message_class: Any = conversions.message_class(type_name)
            self._recorder.add_topic(name, type_name, _offered(infos[0].qos_profile))
        except (BagError, ImportError, AttributeError, ValueError) as error:
            self._ignored.add(name)
            self._node.get_logger().warning(f"{name} is not recorded: {error}")
            return
        callback = partial(self._on_message, name, type_name)
        self._node.create_subscription(message_class, name, callback, _accepting(infos), raw=True)

    def _on_message(self, topic: str, type_name: str, data: bytes) -> None:
        self._messages += 1
        self._recorder.record(topic, type_name, data)
        if type_name == _TICK_TYPE:
            self._tick_at = time.monotonic()


def _accepting(infos: list[TopicEndpointInfo]) -> QoSProfile:
    """Ask for the best that every publisher of the topic offers."""
    reliable = all(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in infos)
    latched = all(info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for info in infos)
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _offered(profile: QoSProfile) -> TopicQos:
    return TopicQos(
        profile.history.name.lower(), profile.depth, profile.reliability.name.lower(), profile.durability.name.lower()
    )


def main() -> int:
    """Run the node until it ends."""
    return run_node("recorder", RecorderNode)


if __name__ == "__main__":
    raise SystemExit(main())
