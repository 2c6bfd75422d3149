"""Nodes that one process forks are the launcher's own children, each with a name, a log and an end of its own."""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from graph_tools import alive, launch, short_scenario
from robot_formation.experiment.run_result import RunError
from robot_formation.launching.environment import node_environment
from robot_formation.launching.fork_server import ForkServer, NodeNotStartedError
from robot_formation.network.ros_domain import DomainReservation, domain_ports
from robot_formation.network.shared_memory import clean_after_graph, fast_dds_files, find_orphans
from robot_formation.nodes.host import signals

pytestmark = pytest.mark.graph

WRONG = ["--ros-args", "-r", "__ns:=/leader", "-p", "nonsense:=1"]
RIGHT = ["--ros-args", "-r", "__ns:=/leader"]


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[dict[str, str]]:
    with DomainReservation() as domain:
        yield node_environment(domain, tmp_path)


def touched(log: Path) -> Path:
    log.touch()
    return log


def ended(pid: int) -> int:
    """The exit code of a child, negative for a signal; only a process's own children can be waited for."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def parent_of(stat: Path) -> int:
    """The parent of a process, by /proc/PID/stat; 0 if it is gone."""
    with contextlib.suppress(OSError):
        return int(stat.read_text().rpartition(")")[2].split()[1])
    return 0


def test_a_node_ends_with_its_own_code_and_its_words_are_in_its_own_log(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    with ForkServer(environment, tmp_path / "server.log") as server:
        pids = [server.start("drive", words, touched(tmp_path / name)) for name, words in (("a", WRONG), ("b", RIGHT))]
    assert ended(pids[0]) == 2
    assert "no parameter 'nonsense'" in (tmp_path / "a").read_text()
    while "ready" not in (tmp_path / "b").read_text():
        assert alive(pids[1])
        time.sleep(0.01)
    title = Path(f"/proc/{pids[1]}/cmdline").read_bytes().rstrip(b"\0").decode()
    assert title == "robot_formation drive --ros-args -r __ns:=/leader"
    assert os.getsid(pids[1]) == pids[1]  # a terminal's Ctrl-C is for the launcher
    os.kill(pids[1], signal.SIGINT)
    assert ended(pids[1]) == 0
    assert (tmp_path / "server.log").read_text() == ""


def test_a_killed_node_is_told_by_its_signal(tmp_path: Path, environment: dict[str, str]) -> None:
    with ForkServer(environment, tmp_path / "server.log") as server:
        pid = server.start("leader", RIGHT, touched(tmp_path / "leader"))
    os.kill(pid, signal.SIGKILL)
    assert ended(pid) == -signal.SIGKILL


@pytest.mark.parametrize("farewell", [True, False])
def test_a_node_without_farewell_leaves_its_shared_memory_to_the_launcher(
    tmp_path: Path, environment: dict[str, str], farewell: bool
) -> None:
    domain, log = int(environment["ROS_DOMAIN_ID"]), touched(tmp_path / "log")
    with ForkServer(environment, tmp_path / "server.log", farewell=farewell) as server:
        pid = server.start("drive", RIGHT, log)
    while "ready" not in log.read_text():
        assert alive(pid)
        time.sleep(0.01)
    os.kill(pid, signal.SIGINT)
    assert ended(pid) == 0
    own = {f"fastrtps_port{port}" for port in domain_ports(domain)}
    assert own.isdisjoint(find_orphans(domain)) is farewell
    clean_after_graph(domain)
    assert own.isdisjoint(fast_dds_files())


def test_a_node_whose_launcher_is_gone_says_farewell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signals, "_launcher", None)
    assert signals.says_farewell()
    signals.end_without_farewell(os.getppid())
    assert not signals.says_farewell()
    signals.end_without_farewell(os.getpid())  # any process but the parent
    assert signals.says_farewell()


def test_what_cant_be_imported_is_one_line(tmp_path: Path, environment: dict[str, str]) -> None:
    (tmp_path / "rclpy.py").write_text("raise ImportError('librcl.so is missing')\n")
    path = os.pathsep.join([str(tmp_path), environment.get("PYTHONPATH", "")])
    with (
        ForkServer({**environment, "PYTHONPATH": path}, tmp_path / "server.log") as server,
        pytest.raises(RunError, match=r"^the nodes can't be started: ImportError: librcl\.so is missing$"),
    ):
        server.start("drive", RIGHT, tmp_path / "drive")


def test_a_killed_server_is_named_and_a_stopped_one_is_not_waited_for_after_an_interrupt(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    (tmp_path / "node").touch()
    with ForkServer(environment, tmp_path / "server.log") as server:
        server._process.kill()
        with pytest.raises(NodeNotStartedError, match=r"^drive was not started: .* was killed by SIGKILL$"):
            server.start("drive", RIGHT, tmp_path / "node")
    with ForkServer(environment, tmp_path / "server.log") as server:
        server._process.send_signal(signal.SIGSTOP)
        with pytest.raises(NodeNotStartedError, match="interrupted"):
            server.start("drive", RIGHT, tmp_path / "node", give_up=lambda: True)
    assert server._process.returncode == -signal.SIGKILL


def test_a_node_that_is_forked_when_nobody_waits_for_it_any_more_is_ended(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    (tmp_path / "node").touch()
    with ForkServer(environment, tmp_path / "server.log") as server:
        server._process.send_signal(signal.SIGSTOP)
        with pytest.raises(NodeNotStartedError, match="interrupted"):
            server.start("drive", RIGHT, tmp_path / "node", give_up=lambda: True)
        server._process.send_signal(signal.SIGCONT)
    assert server._process.returncode == 0
    titles = [
        (entry.parent / "cmdline").read_bytes()
        for entry in Path("/proc").glob("[0-9]*/stat")
        if parent_of(entry) == os.getpid()
    ]
    assert not any(title.startswith(b"robot_formation drive") for title in titles)


def test_a_run_whose_nodes_cannot_be_forked_ends_as_one_whose_node_died(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entered = ForkServer.__enter__

    def killed(server: ForkServer) -> ForkServer:
        entered(server)
        server._process.kill()
        return server

    monkeypatch.setattr(ForkServer, "__enter__", killed)
    result = launch(short_scenario(), tmp_path / "bag")
    assert result.exit_code == 4
    assert "the process that starts nodes was killed by SIGKILL" in result.reason
    assert (result.bag, list(tmp_path.iterdir())) == (None, [])


def test_orphans_are_adopted_only_while_nodes_start(tmp_path: Path, environment: dict[str, str]) -> None:
    with ForkServer(environment, tmp_path / "server.log"):
        pass
    code = "import os, sys; pid = os.fork(); print(pid, flush=True) if pid else os.execlp('sleep', 'sleep', '30')"
    reading, writing = os.pipe()
    child = os.posix_spawn(
        sys.executable, [sys.executable, "-c", code], os.environ, file_actions=[(os.POSIX_SPAWN_DUP2, writing, 1)]
    )
    os.waitpid(child, 0)
    orphan = int(os.read(reading, 20))
    os.close(reading)
    os.close(writing)
    try:
        status = Path(f"/proc/{orphan}/stat").read_text().rpartition(")")[2].split()
        assert int(status[1]) != os.getpid()
    finally:
        os.kill(orphan, signal.SIGKILL)
