"""What a run leaves behind when a node dies, the leader is lost or a person interrupts."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from graph_tools import Killer, alive, launch, short_scenario
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.network.ros_domain import domain_ports
from robot_formation.network.shared_memory import find_orphans

pytestmark = pytest.mark.graph

NODES = (
    "/world",
    "/overhead_tracker",
    "/leader/drive",
    "/leader/leader",
    "/follower_1/drive",
    "/follower_1/block_detector",
    "/follower_1/predictor",
    "/follower_1/fine_tuner",
    "/recorder",
)
# One of each kind: what owns time, a drive, what ticks, the recorder. All others, at random moments:
# bench/kill_campaign.py.
KILLED = ("/world", "/leader/drive", "/follower_1/fine_tuner", "/recorder")
LONG = ("leader.timesteps=50",)
SLOW = ("world.real_time_factor=10",)
"""The run has to last longer than the 6 s for which a node may be stopped."""


def shared_memory_ports(domain: int) -> list[str]:
    """Shared-memory files that belong to a domain's ports."""
    ports = {f"port{port}" for port in domain_ports(domain)}
    return [name for name in os.listdir("/dev/shm") if any(name.endswith(p) or f"{p}_" in name for p in ports)]


@pytest.mark.parametrize("node", [KILLED[0], *(pytest.param(node, marks=pytest.mark.long) for node in KILLED[1:])])
def test_a_killed_node_ends_the_run_by_name_with_a_readable_bag(tmp_path: Path, node: str) -> None:
    killer = Killer(node, signal.SIGKILL, after_timesteps=3)
    domains = []

    def on_start(domain: int, pids: dict[str, int]) -> None:
        domains.append(domain)
        killer.started(domain, pids)

    result = launch(short_scenario(*LONG), tmp_path / "bag", say=killer.say, on_start=on_start)
    # At once: the domain is free for other tests now.
    # Ports 7000 and up are shared by all domains: what another test's process still holds now may be an orphan later.
    assert shared_memory_ports(domains[0]) == []
    assert {group for group in find_orphans(domains[0]) if not group.startswith("fastrtps_port70")} == set()
    assert result.exit_code == 4
    assert f"node {node} was killed by SIGKILL" in result.reason
    assert set(killer.pids) == set(NODES)
    assert not any(alive(pid) for pid in killer.pids.values())
    analysis = analyse(load_run(tmp_path / "bag"))
    # The signal comes when timestep 3 is told, which may be before its tick: what was finished before is there.
    assert len(analysis.followers[0].timesteps) >= 2
    assert analysis.outcome == "incomplete"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag"]


@pytest.mark.long
@pytest.mark.parametrize("node", ["/follower_1/predictor", "/recorder"])
def test_a_stopped_node_ends_the_run_by_name_with_a_whole_bag(tmp_path: Path, node: str) -> None:
    killer = Killer(node, signal.SIGSTOP, after_timesteps=2)
    result = launch(short_scenario(*LONG, *SLOW), tmp_path / "bag", say=killer.say, on_start=killer.started)
    assert result.exit_code == 4
    assert f"node {node} was stopped" in result.reason
    assert not any(alive(pid) for pid in killer.pids.values())
    assert len(analyse(load_run(tmp_path / "bag")).followers[0].timesteps) >= 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag"]


@pytest.mark.long
@pytest.mark.parametrize("node", ["/overhead_tracker", "/recorder"])
def test_a_node_stopped_at_the_end_is_named_and_the_bag_is_whole(tmp_path: Path, node: str) -> None:
    killer = Killer(node, signal.SIGSTOP, after_timesteps=4)
    result = launch(short_scenario(), tmp_path / "bag", say=killer.say, on_start=killer.started)
    assert result.exit_code == 4
    assert f"node {node} was stopped" in result.reason
    assert len(analyse(load_run(tmp_path / "bag")).followers[0].timesteps) == 4


@pytest.mark.long
def test_a_launcher_that_was_stopped_for_a_while_goes_on(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "robot_formation.cli", "run", "--camera", "on_demand", "--json"]
    command += ["--set", "leader.timesteps=4", "--bag", str(tmp_path / "bag")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("timestep  1/"):
                break
        process.send_signal(signal.SIGSTOP)
        # Its nodes go on: the leader's end is what shows that they have come far enough without it.
        children = [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
        while all(map(alive, children)):
            time.sleep(0.02)
        process.send_signal(signal.SIGCONT)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert len(analyse(load_run(tmp_path / "bag")).followers[0].timesteps) == 4


def test_a_lost_leader_ends_the_run_in_good_order(tmp_path: Path) -> None:
    result = launch(short_scenario("world.camera.pan_deg=-90.0"), tmp_path / "bag")
    assert result.exit_code == 3
    assert "follower_1 lost its beacon neighbour in timestep 0" in result.reason
    assert analyse(load_run(tmp_path / "bag")).outcome == "lost"


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_an_interrupted_run_closes_its_bag_and_leaves_no_process(tmp_path: Path, number: signal.Signals) -> None:
    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "robot_formation.cli", "run", "--camera", "on_demand", "--json"]
    command += ["--set", "leader.timesteps=500", "--set", "leader.step_m=0.001", "--bag", str(bag)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("timestep  2/"):
                break
        children = [
            int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split() if pid
        ]
        assert len(children) == len(NODES)
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert not any(alive(pid) for pid in children)
    assert (bag / "metadata.yaml").is_file()
    assert len(analyse(load_run(bag)).followers[0].timesteps) >= 2


def test_nodes_end_when_their_launcher_is_killed(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "robot_formation.cli", "run", "--camera", "on_demand"]
    command += ["--set", "leader.timesteps=500", "--set", "leader.step_m=0.001", "--bag", str(bag)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("timestep  2/"):
                break
        children = [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]
        process.kill()
        process.wait()
    descriptors = []
    for pid in children:
        try:
            descriptors.append(os.pidfd_open(pid))
        except ProcessLookupError:
            continue
    for descriptor in descriptors:
        assert _readable(descriptor, timeout_s=20.0)
        os.close(descriptor)
    assert (bag / "metadata.yaml").is_file()


def _readable(descriptor: int, timeout_s: float) -> bool:
    """A process's descriptor becomes readable when it ends."""
    import select

    return bool(select.select([descriptor], [], [], timeout_s)[0])
