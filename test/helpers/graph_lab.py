"""A ROS domain of a test's own, with node processes and a node of the test in it."""

import contextlib
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from forked_nodes import ForkedNode
from graph_tools import STRICT
from robot_formation import conversions
from robot_formation.launching.environment import node_environment
from robot_formation.names import Topic, absolute
from robot_formation.network.ros_domain import DomainReservation
from robot_formation.network.shared_memory import clean_after_graph
from robot_formation.nodes.host.qos import qos_profile

DEADLINE_S = 90.0  # long enough for a machine that others keep busy


class Lab:
    """Node processes and a test node in a ROS domain of their own."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain = domain
        self.environment = node_environment(domain, folder)
        self.processes: list[subprocess.Popen[str]] = []
        self.join()

    def join(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self.domain, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node("stranger", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self._listeners: dict[str, Node] = {}

    def leave(self) -> None:
        self.executor.shutdown()
        for node in (self.node, *self._listeners.values()):
            node.destroy_node()
        rclpy.shutdown(context=self.context)

    def rejoin(self) -> None:
        """Look at the graph anew: the middleware may list a node for good whose last words came after its farewell."""
        self.leave()
        self.join()

    def start(self, name: str, *arguments: str, namespace: str = "/") -> subprocess.Popen[str]:
        """Start a node with Python's warnings as errors, in a session of its own, as a terminal would."""
        words = ["--ros-args", "-r", f"__ns:={namespace}", *arguments]
        self.processes.append(ForkedNode(name, words, {**self.environment, **STRICT}))
        return self.processes[-1]

    def open(
        self, command: Sequence[str], environment: Mapping[str, str], cwd: Path | None = None
    ) -> subprocess.Popen[str]:
        """Start a process in a session of its own, as a terminal would."""
        process = subprocess.Popen(
            command,
            env=environment,
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.processes.append(process)
        return process

    def until(self, condition: Callable[[], object]) -> None:
        """Spin until a condition holds."""
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, "the condition did not come true"
            self.executor.spin_once(0.05)

    def collect(self, topic: Topic, namespace: str = "", *, by: str = "") -> list[Any]:
        """Collect a topic's messages; `by` names the node that listens, if its publisher waits for one of that name."""
        found: list[Any] = []
        kind = conversions.message_class(topic.type)
        node = self._listener(by) if by else self.node
        node.create_subscription(kind, absolute(namespace, topic.name), found.append, qos_profile(topic.qos))
        return found

    def _listener(self, name: str) -> Node:
        if name not in self._listeners:
            self._listeners[name] = Node(name, context=self.context)
            self.executor.add_node(self._listeners[name])
        return self._listeners[name]

    def publisher(self, topic: Topic, namespace: str = "") -> Publisher:
        kind = conversions.message_class(topic.type)
        publisher = self.node.create_publisher(kind, absolute(namespace, topic.name), qos_profile(topic.qos))
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def call(self, service: str) -> Any:
        client = self.node.create_client(Trigger, service)
        self.until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self.until(future.done)
        return future.result()

    def close(self) -> None:
        for process in self.processes:
            process.kill()
            process.communicate()
        self.leave()
        clean_after_graph(self.domain)


AnyLab = TypeVar("AnyLab", bound=Lab)


def values_of(health: Iterable[Any], name: str) -> list[Any]:
    """Values that a node has published on /diagnostics so far."""
    return [
        value for array in health for status in array.status if status.name.endswith(name) for value in status.values
    ]


@contextlib.contextmanager
def open_lab(folder: Path, kind: type[AnyLab]) -> Iterator[AnyLab]:
    """A lab in a free domain, on this machine only; nothing is left of it."""
    with pytest.MonkeyPatch.context() as patch, DomainReservation() as domain:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        made = kind(domain, folder)
        try:
            yield made
        finally:
            made.close()
