"""Which sockets the nodes open, and who finds them."""

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from graph_lab import DEADLINE_S, Lab
from robot_formation import names
from robot_formation.launching.environment import node_environment
from robot_formation.network import loopback
from robot_formation.network.loopback import (
    MANY_NODES,
    PROFILES,
    RANGE,
    stay_here,
    use_loopback,
    use_profile_for_many,
)
from robot_formation.paths import config_dir

PROFILE = str(config_dir() / "loopback.xml")
LOOPBACK = ("0100007F", "00000000000000000000000001000000")


def sockets(pid: int) -> list[str]:
    """Local addresses of a process's UDP and TCP sockets as /proc shows them: hexadecimal, without the port."""
    links = [os.readlink(entry) for entry in Path(f"/proc/{pid}/fd").iterdir() if entry.is_symlink()]
    own = {link[8:-1] for link in links if link.startswith("socket:")}
    found = []
    for table in ("udp", "udp6", "tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[9] in own:
                found.append(words[1].partition(":")[0])
    return found


def on_graph(test: Callable[..., None]) -> Callable[..., None]:
    marked: Callable[..., None] = pytest.mark.graph(pytest.mark.xdist_group("network")(test))
    return marked


@on_graph
def test_no_socket_of_a_node_is_open_to_the_network_and_others_find_it(lab: Lab, tmp_path: Path) -> None:
    heard = lab.collect(names.DIAGNOSTICS)
    nodes = {
        "/leader/drive": lab.start("drive", namespace="/leader"),
        "/follower_1/predictor": lab.start("predictor", namespace="/follower_1"),
        "/recorder": lab.start("recorder", "-p", f"path:={tmp_path / 'bag'}"),
    }
    lab.until(lambda: {status.name for array in heard for status in array.status} >= nodes.keys())
    for name, process in nodes.items():
        addresses = sockets(process.pid)
        assert addresses, name
        assert set(addresses) <= set(LOOPBACK), name


@on_graph
def test_a_node_that_ros_itself_limits_to_this_machine_is_found_too(lab: Lab) -> None:
    """A command of ROS's own, say: it knows nothing of the profile."""
    foreign = {name: value for name, value in lab.environment.items() if name not in PROFILES}
    code = """
import rclpy
rclpy.init()
node = rclpy.create_node("foreign")
while "drive" not in node.get_node_names():
    pass
print("found", flush=True)
"""
    lab.start("drive", namespace="/leader")
    process = lab.open([sys.executable, "-c", code], {**foreign, RANGE: "LOCALHOST"})
    assert process.stdout is not None
    while (line := process.stdout.readline()) != "found\n":  # ROS itself may write lines before
        assert line


MANY = """
import rclpy
from rclpy.context import Context
from rclpy.node import Node

contexts = [Context() for _ in range(14)]
nodes = []
for number, context in enumerate(contexts):
    rclpy.init(context=context)
    nodes.append(Node(f"node_{number}", context=context))
while any(len(set(node.get_node_names())) < len(nodes) for node in nodes):
    pass
print("found", flush=True)
"""


@on_graph
@pytest.mark.parametrize("many", [False, True], ids=["profile", "profile for many"])
def test_fourteen_participants_of_one_domain_find_each_other(lab: Lab, tmp_path: Path, many: bool) -> None:
    environment = dict(lab.environment)
    if many:
        use_profile_for_many(environment, tmp_path, MANY_NODES)
        assert environment[PROFILES[0]] == str(tmp_path / "loopback_many.xml")
    process = lab.open([sys.executable, "-c", MANY], environment)
    out, error = process.communicate(timeout=DEADLINE_S)
    assert out.endswith("found\n"), error
    assert "XMLPARSER" not in out + error


@pytest.mark.parametrize("room", [False, True], ids=["small /dev/shm", "room in /dev/shm"])
def test_the_profile_for_many_nodes_differs_in_three_values_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: bool
) -> None:
    free = SimpleNamespace(free=2**30 if room else 64 * 2**20)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: free)
    environment = {RANGE: "SYSTEM_DEFAULT", **dict.fromkeys(PROFILES, PROFILE)}
    use_profile_for_many(environment, tmp_path, 45)
    changed = tmp_path / "loopback_many.xml"
    assert environment == {RANGE: "SYSTEM_DEFAULT", **dict.fromkeys(PROFILES, str(changed))}
    before, after = (
        [(entry.tag, (entry.text or "").strip()) for entry in ElementTree.parse(file).iter()]
        for file in (PROFILE, changed)
    )
    tag = "{http://www.eprosima.com}"
    assert [entry for entry in before if entry not in after] == [(f"{tag}count", "20"), (f"{tag}nanosec", "100000000")]
    added = [(f"{tag}segment_size", "2097152")] * room + [(f"{tag}count", "8"), (f"{tag}nanosec", "300000000")]
    assert [entry for entry in after if entry not in before] == added
    assert not changed.read_text().count("ns0:")
    transports = ElementTree.parse(changed).iter(f"{tag}transport_descriptor")
    sizes = {found.findtext(f"{tag}type"): found.findtext(f"{tag}segment_size") for found in transports}
    assert sizes == {"UDPv4": None, "SHM": "2097152" if room else None}


@pytest.mark.parametrize("own", [{}, dict.fromkeys(PROFILES, "/home/somebody/mine.xml")])
def test_a_profile_of_the_users_own_stays_for_many_nodes_too(own: dict[str, str], tmp_path: Path) -> None:
    environment = dict(own)
    use_profile_for_many(environment, tmp_path, MANY_NODES)
    assert environment == own
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("nodes", "expected"), [(MANY_NODES - 1, PROFILE), (MANY_NODES, "loopback_many.xml")])
def test_a_run_of_many_nodes_gets_that_profile(
    nodes: int, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in PROFILES:
        monkeypatch.delenv(name, raising=False)
    profile = node_environment(7, tmp_path, nodes)[PROFILES[0]]
    assert profile in (expected, str(tmp_path / expected))


@pytest.mark.parametrize("middleware", [{}, {"RMW_IMPLEMENTATION": "rmw_fastrtps_dynamic_cpp"}])
@pytest.mark.parametrize("earlier", [{}, dict.fromkeys(PROFILES, PROFILE)])
def test_discovery_on_this_machine_gets_the_profile(middleware: dict[str, str], earlier: dict[str, str]) -> None:
    environment = {RANGE: "LOCALHOST", **middleware, **earlier}
    use_loopback(environment)
    assert environment == {RANGE: "SYSTEM_DEFAULT", **middleware, **dict.fromkeys(PROFILES, PROFILE)}


@pytest.mark.parametrize(
    "wish",
    [
        {},
        {RANGE: "SUBNET"},
        {RANGE: "LOCALHOST", "ROS_STATIC_PEERS": "192.168.0.7"},
        {RANGE: "LOCALHOST", "ROS_DISCOVERY_SERVER": "192.168.0.7:11811"},
        {RANGE: "LOCALHOST", "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
        {RANGE: "LOCALHOST", PROFILES[0]: "/home/somebody/mine.xml"},
        {RANGE: "LOCALHOST", PROFILES[1]: "/home/somebody/mine.xml"},
    ],
)
def test_whoever_asks_for_something_else_gets_that(wish: dict[str, str]) -> None:
    environment = dict(wish)
    use_loopback(environment)
    assert environment == wish


def test_without_the_profile_ros_limits_discovery_itself(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(loopback, "config_dir", lambda: tmp_path)
    environment = {RANGE: "LOCALHOST"}
    use_loopback(environment)
    assert environment == {RANGE: "LOCALHOST"}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, "SYSTEM_DEFAULT"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "SUBNET"),
        ({"ROS_STATIC_PEERS": "10.0.0.2"}, None),
        ({"ROS_DISCOVERY_SERVER": "10.0.0.2:11811"}, None),
        ({"ROS_LOCALHOST_ONLY": "1"}, None),
    ],
)
def test_verbs_stay_on_this_machine_unless_the_user_asks_otherwise(given: dict[str, str], expected: str | None) -> None:
    environment = dict(given)
    stay_here(environment)
    assert environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == expected
    assert (expected == "SYSTEM_DEFAULT") == any(name in environment for name in PROFILES)
