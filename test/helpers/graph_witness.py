"""Reads who listens to what in a live graph, from a hidden node of its own."""

import threading
from collections.abc import Collection
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from graph_tools import launch
from robot_formation.experiment.scenario import Scenario

MOST_RUNS = 3
FOLLOWER_NODES = ("drive", "block_detector", "predictor", "fine_tuner")


class Witness:
    """Reads the graph of a run while it goes on, from a hidden node of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._monkeypatch = monkeypatch
        self._nodes: set[str] = set()
        self.subscriptions: dict[tuple[str, str], set[str]] = {}
        self.clients: dict[tuple[str, str], set[str]] = {}
        self.publishers: dict[tuple[str, str], set[str]] = {}
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def started(self, domain: int, pids: dict[str, int]) -> None:
        self._nodes = set(pids)
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
        if self._thread is not None:
            self._thread.join()

    def unseen(self, heard: Collection[str]) -> set[str]:
        """Nodes of the run, and topics that somebody is to listen to, which it has not seen."""
        seen = {f"{namespace.rstrip('/')}/{name}" for namespace, name in self.subscriptions}
        return (self._nodes - seen) | (set(heard) - set().union(*self.subscriptions.values()))


def witnessed_run(
    scenario: Scenario, folder: Path, monkeypatch: pytest.MonkeyPatch, heard: Collection[str] = ()
) -> Witness:
    """Run a scenario over the graph; return what was seen of it.

    On a busy machine a short run may be over before all of it was discovered: then it is run again.

    Args:
        scenario: what is run.
        folder: of its bags.
        monkeypatch: the test's.
        heard: topics that somebody listens to.
    """
    for number in range(MOST_RUNS):
        witness = Witness(monkeypatch)
        try:
            result = launch(scenario, folder / f"bag_{number}", on_start=witness.started)
        finally:
            witness.finish()
        assert (result.exit_code, result.reason) == (0, "")
        if not witness.unseen(heard):
            return witness
    raise AssertionError(f"not seen in {MOST_RUNS} runs: {sorted(witness.unseen(heard))}")
