"""Reads who listens to what in a live graph, from a hidden node of its own."""

import threading
from collections.abc import Sequence

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

FOLLOWER_NODES = ("drive", "block_detector", "predictor", "fine_tuner")


class Witness:
    """Reads the graph of a run while it goes on, from a hidden node of its own."""

    def __init__(self, robots: Sequence[str], monkeypatch: pytest.MonkeyPatch) -> None:
        self._robots = robots
        self._monkeypatch = monkeypatch
        self.subscriptions: dict[tuple[str, str], set[str]] = {}
        self.clients: dict[tuple[str, str], set[str]] = {}
        self.publishers: dict[tuple[str, str], set[str]] = {}
        self._stop = threading.Event()

    def started(self, domain: int, pids: dict[str, int]) -> None:
        self._monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        self._thread = threading.Thread(target=self._watch, args=(domain,))
        self._thread.start()

    def _watch(self, domain: int) -> None:
        context = Context()
        rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        node = Node("_witness", context=context, enable_rosout=False, start_parameter_services=False)
        while not self._stop.wait(0.05):
            for name, namespace in node.get_node_names_and_namespaces():
                if name.startswith("_"):
                    continue
                key = (namespace, name)
                try:
                    topics = node.get_subscriber_names_and_types_by_node(name, namespace)
                    clients = node.get_client_names_and_types_by_node(name, namespace)
                    published = node.get_publisher_names_and_types_by_node(name, namespace)
                except rclpy.node.NodeNameNonExistentError:
                    continue
                self.subscriptions.setdefault(key, set()).update(topic for topic, _ in topics)
                self.clients.setdefault(key, set()).update(service for service, _ in clients)
                self.publishers.setdefault(key, set()).update(topic for topic, _ in published)
        node.destroy_node()
        rclpy.shutdown(context=context)

    def finish(self) -> None:
        self._stop.set()
        self._thread.join()
