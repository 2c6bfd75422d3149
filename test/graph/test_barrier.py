"""The live graph: who listens to what, and who calls whom."""

import threading
from collections.abc import Sequence
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from graph_tools import launch, short_scenario
from robot_formation import names

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("barrier")]

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


@pytest.mark.parametrize("followers", [1, 2])
def test_a_follower_hears_nothing_but_itself_and_its_neighbours_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, followers: int
) -> None:
    scenario = short_scenario(f"followers={followers}", "leader.timesteps=3", track="one")
    witness = Witness(scenario.robots, monkeypatch)
    result = launch(scenario, tmp_path / "bag", on_start=witness.started)
    witness.finish()
    assert result.exit_code == 0
    for number in range(1, followers + 1):
        robot = names.follower(number)
        tick = names.formation_done(names.beacon_neighbour(robot)).name
        heard_neighbour = False
        for name in FOLLOWER_NODES:
            heard = witness.subscriptions[(f"/{robot}", name)]
            allowed = {"/clock", "/parameter_events", tick}
            foreign = {topic for topic in heard if topic not in allowed and not topic.startswith(f"/{robot}/")}
            assert foreign == set(), f"{robot}/{name}"
            assert all(service.startswith(f"/{robot}/") for service in witness.clients[(f"/{robot}", name)])
            heard_neighbour = heard_neighbour or tick in heard
        assert heard_neighbour, "the whitelist would hold for a deaf follower too"


def test_the_witness_would_see_a_breach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The world listens outside any robot's namespace: what the barrier's test looks for can be seen."""
    scenario = short_scenario("leader.timesteps=8")
    witness = Witness(scenario.robots, monkeypatch)
    launch(scenario, tmp_path / "bag", on_start=witness.started)
    witness.finish()
    assert "/leader/joint_commands" in witness.subscriptions[("/", "world")]
    assert "/ground_truth/leader/odom" in witness.subscriptions[("/", "recorder")]
    assert "/formation/follower_1/done" in witness.subscriptions[("/leader", "leader")]
