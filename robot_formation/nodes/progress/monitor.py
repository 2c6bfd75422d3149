"""A hidden node inside the launcher's own process that follows a run for its progress."""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from types import TracebackType

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from robot_formation import conversions, names
from robot_formation.names import Message
from robot_formation.network.loopback import BEYOND, PROFILES, RANGE
from robot_formation.nodes.host.executor import make_executor
from robot_formation.nodes.host.living_nodes import node_names
from robot_formation.nodes.host.qos import qos_profile
from robot_formation.system.variables import set_for_a_while

# Nodes whose names begin with an underscore are hidden: nobody waits for them, and lists leave them out.
_NAME = "_monitor"
_QUIET_ROUNDS, _MOST_ROUNDS = 3, 60
# What a process must have in common with the run's nodes to find them at once, and where rclpy writes its log.
_JOINING = (*PROFILES, RANGE, *BEYOND, "ROS_LOG_DIR")


def topic_of(name: str) -> names.Topic:
    """Return type and quality of service of a topic that `Progress` wants."""
    types = {topic.name: topic for topic in (names.MOVED, names.ALIGNMENT, names.DISPLACEMENT)}
    return types.get(name.rpartition("/")[2]) or names.ground_truth_pose("")


class Monitor:
    """Listens to topics of a domain, and to the nodes' reports; a context manager. `spin` takes what has arrived.

    Attributes:
        messages: how many have come on the topics.
        reports: how often each node, by its full name, has reported on /diagnostics.
        pauses: how many of these reports say that the world is paused: then nobody is to be expected to do anything.
    """

    def __init__(
        self, environment: Mapping[str, str], topics: list[str], listen: Callable[[str, Message], None]
    ) -> None:
        """Join the graph.

        Args:
            environment: that of the run's nodes; its domain, discovery range and log folder count.
            topics: absolute names of topics that the run's nodes have.
            listen: called with topic and message.
        """
        self._context = Context()
        with set_for_a_while({name: environment.get(name) for name in _JOINING}):
            domain = int(environment["ROS_DOMAIN_ID"])
            rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
            # Here too: the middleware reads its settings when the first node is made.
            self._node = Node(_NAME, context=self._context, start_parameter_services=False, enable_rosout=False)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._listen = listen
        self.messages = 0
        self.reports: Counter[str] = Counter()
        self.pauses = 0
        for name in topics:
            topic = topic_of(name)
            message_class = conversions.message_class(topic.type)
            self._node.create_subscription(message_class, name, partial(self._take, name), qos_profile(topic.qos))

        health = names.DIAGNOSTICS
        self._node.create_subscription(
            conversions.message_class(health.type), health.name, self._take_report, qos_profile(health.qos)
        )

    def spin(self, timeout_s: float) -> None:
        """Wait for a message at most so long; take it and what else is there."""
        before = self.messages
        self._executor.spin_once(timeout_s)
        while self.messages != before:
            before = self.messages
            self._executor.spin_once(0.0)

    def drain(self, round_s: float, enough: Callable[[], bool] = lambda: False) -> None:
        """Process what is still on its way: until it is enough, or some rounds in a row have brought nothing."""
        quiet = 0
        for _ in range(_MOST_ROUNDS):
            if enough():
                return
            before = self.messages
            self.spin(round_s)
            quiet = quiet + 1 if self.messages == before else 0
            if quiet == _QUIET_ROUNDS:
                return

    def nodes(self) -> set[str]:
        """Return the full names of the nodes that are in the graph."""
        return node_names(self._node)

    def __enter__(self) -> Monitor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        # The shared memory of this participant is given back with the last reference, and rclpy's objects form cycles.
        del self._executor, self._node, self._context
        gc.collect()

    def _take_report(self, message: Message) -> None:
        for status in message.status:
            self.reports[status.name] += 1
            self.pauses += any(value.key == names.PAUSED and value.value == str(True) for value in status.values)

    def _take(self, topic: str, message: Message) -> None:
        self.messages += 1
        self._listen(topic, message)
