"""Shared memory of dead ROS processes is removed, that of living ones never."""

import fcntl
import importlib.util
import mmap
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_formation.network import shared_memory
from robot_formation.network.ros_domain import DomainReservation, domain_ports
from robot_formation.network.shared_memory import clean_orphans, fast_dds_files, find_orphans
from robot_formation.network.shared_memory_space import SHARED_MEMORY

NODE = """
import rclpy
rclpy.init()
node = rclpy.create_node('shared_memory_test')
print('up', flush=True)
rclpy.spin(node)
"""

SEGMENT = "fastrtps_0123456789abcdef"


def make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).touch()


def lock(path: Path) -> int:
    descriptor = os.open(path, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    return descriptor


def test_files_without_a_living_owner_are_removed(tmp_path: Path) -> None:
    names = {SEGMENT, f"{SEGMENT}_el", "fastrtps_port7413", "fastrtps_port7413_sl", "sem.fastrtps_port7413_mutex"}
    make(tmp_path, *names)
    assert set(clean_orphans(folder=tmp_path)) == names
    assert not list(tmp_path.iterdir())


def test_files_whose_owner_lives_stay(tmp_path: Path) -> None:
    make(tmp_path, SEGMENT, f"{SEGMENT}_el", "fastrtps_port7413", "fastrtps_port7413_el", "sem.fastrtps_port7413_mutex")
    descriptor = lock(tmp_path / "fastrtps_port7413_el")
    try:
        assert find_orphans(folder=tmp_path) == {SEGMENT: [SEGMENT, f"{SEGMENT}_el"]}
        assert clean_orphans(folder=tmp_path) == [SEGMENT, f"{SEGMENT}_el"]
    finally:
        os.close(descriptor)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_port_that_several_share_stays_while_one_of_them_lives(tmp_path: Path) -> None:
    make(tmp_path, "fastrtps_port7400", "fastrtps_port7400_sl")
    descriptor = os.open(tmp_path / "fastrtps_port7400_sl", os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_SH)
    try:
        assert clean_orphans(folder=tmp_path) == []
    finally:
        os.close(descriptor)


def test_a_lock_file_that_is_open_but_not_yet_locked_counts_as_alive(tmp_path: Path) -> None:
    make(tmp_path, SEGMENT, f"{SEGMENT}_el")
    with open(tmp_path / f"{SEGMENT}_el"):
        assert clean_orphans(folder=tmp_path) == []
    assert clean_orphans(folder=tmp_path) == [SEGMENT, f"{SEGMENT}_el"]


def test_a_port_without_lock_file_is_removed_unless_somebody_has_it_mapped(tmp_path: Path) -> None:
    port = "fastrtps_port7413"
    make(tmp_path, port)
    (tmp_path / port).write_bytes(b"x")
    with open(tmp_path / port, "r+b") as file, mmap.mmap(file.fileno(), 0):
        file.close()
        assert clean_orphans(folder=tmp_path) == []
    assert clean_orphans(folder=tmp_path) == [port]


def test_a_port_that_this_process_has_sent_to_is_removed_once_it_has_no_participant(tmp_path: Path) -> None:
    port = "fastrtps_port7413"
    make(tmp_path, port, f"{port}_el")
    (tmp_path / port).write_bytes(b"x")
    with open(tmp_path / port, "r+b") as file, mmap.mmap(file.fileno(), 0):
        file.close()
        descriptor = lock(tmp_path / f"{port}_el")
        assert clean_orphans(folder=tmp_path, own_ports=False) == []
        os.close(descriptor)
        assert clean_orphans(folder=tmp_path) == []
        assert clean_orphans(folder=tmp_path, own_ports=False) == [port, f"{port}_el"]


MAPPING = """
import mmap, sys
with open(sys.argv[1], "r+b") as file:
    mapped = mmap.mmap(file.fileno(), 0)
print("up", flush=True)
sys.stdin.read()
"""


def test_a_dead_owners_segment_is_removed_although_this_process_has_it_mapped(tmp_path: Path) -> None:
    make(tmp_path, SEGMENT, f"{SEGMENT}_el")
    (tmp_path / SEGMENT).write_bytes(b"x")
    with open(tmp_path / SEGMENT, "r+b") as file, mmap.mmap(file.fileno(), 0):
        file.close()
        descriptor = lock(tmp_path / f"{SEGMENT}_el")
        assert clean_orphans(folder=tmp_path) == []
        os.close(descriptor)
        assert clean_orphans(folder=tmp_path) == [SEGMENT, f"{SEGMENT}_el"]


def test_a_segment_stays_while_another_process_has_it_mapped(tmp_path: Path) -> None:
    make(tmp_path, SEGMENT, f"{SEGMENT}_el")
    (tmp_path / SEGMENT).write_bytes(b"x")
    command = [sys.executable, "-c", MAPPING, str(tmp_path / SEGMENT)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        assert clean_orphans(folder=tmp_path) == []
        process.communicate()
    assert clean_orphans(folder=tmp_path) == [SEGMENT, f"{SEGMENT}_el"]


@pytest.fixture
def unused_port() -> Iterator[tuple[int, str]]:
    """A port of the machine's shared memory that no process has, and its domain."""
    with DomainReservation() as domain:
        port = f"fastrtps_port{domain_ports(domain)[-1]}"
        yield domain, port
        for name in fast_dds_files().get(port, []):
            (SHARED_MEMORY / name).unlink()


OPENING = """
import pathlib, sys
from robot_formation.network.port_mutex import PortMutex
with PortMutex("{port}") as taken:
    assert taken
    for name in ("{port}", "{port}_el"):
        pathlib.Path("{folder}", name).touch()
    print("opening", flush=True)
    sys.stdin.readline()
"""


def test_a_port_that_a_process_is_opening_stays(unused_port: tuple[int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    domain, port = unused_port
    code = OPENING.format(port=port, folder=SHARED_MEMORY)
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "opening\n"
        names = [port, f"{port}_el", f"sem.{port}_mutex"]
        assert fast_dds_files()[port] == names
        with monkeypatch.context() as patch:  # it began just after its files had been looked at
            patch.setattr(shared_memory, "find_orphans", lambda *_, **__: {port: names})
            assert clean_orphans(domain) == []
        process.communicate("go on\n")
    clean_orphans(domain)
    assert port not in fast_dds_files()


def test_files_that_vanish_meanwhile_are_no_orphans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_memory, "fast_dds_files", lambda _: {SEGMENT: [SEGMENT, f"{SEGMENT}_el"]})
    assert find_orphans(folder=tmp_path) == {}


def test_a_port_whose_owner_was_killed_while_opening_it_is_removed(unused_port: tuple[int, str]) -> None:
    domain, port = unused_port
    code = f"""
import os
from robot_formation.network.port_mutex import PortMutex
with PortMutex("{port}") as taken:
    open("{SHARED_MEMORY / port}", "w").close()
    os._exit(0 if taken else 1)
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    clean_orphans(domain)
    assert port not in fast_dds_files()


def test_foreign_files_stay(tmp_path: Path) -> None:
    make(tmp_path, "fastrtps_port", "fastrtps_xyz_el", "somebody_elses", "lttng")
    assert clean_orphans(folder=tmp_path) == []
    assert len(list(tmp_path.iterdir())) == 4


def test_cleaning_one_domain_leaves_the_ports_of_others(tmp_path: Path) -> None:
    ports = {"mine": 7400 + 250 * 3 + 11, "other": 7400 + 250 * 4, "any": 7000}
    make(tmp_path, *(f"fastrtps_port{port}_el" for port in ports.values()))
    assert set(clean_orphans(3, tmp_path)) == {f"fastrtps_port{ports['mine']}_el", f"fastrtps_port{ports['any']}_el"}


def test_a_missing_folder_is_no_error(tmp_path: Path) -> None:
    assert clean_orphans(folder=tmp_path / "nowhere") == []


@pytest.mark.graph
@pytest.mark.xdist_group("experiment_shared_memory")
def test_a_killed_node_leaves_files_that_are_removed_and_a_living_one_keeps_its_own() -> None:
    if importlib.util.find_spec("rclpy") is None:
        pytest.skip("ROS is not installed")
    with DomainReservation() as domain:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}

        def start() -> subprocess.Popen[bytes]:
            node = subprocess.Popen([sys.executable, "-c", NODE], env=environment, stdout=subprocess.PIPE)
            assert node.stdout is not None
            while (line := node.stdout.readline()) != b"up\n":  # ROS itself may write lines before
                assert line
            return node

        def files_of(node: subprocess.Popen[bytes]) -> set[str]:
            opened = {os.path.realpath(entry) for entry in os.scandir(f"/proc/{node.pid}/fd")}
            groups = {path.removeprefix("/dev/shm/").removesuffix("_el") for path in opened if path.endswith("_el")}
            return {name for group, names in fast_dds_files().items() if group in groups for name in names}

        living, doomed = start(), start()
        try:
            kept, left = files_of(living), files_of(doomed)
            assert kept
            assert left
            assert kept.isdisjoint(left)
            assert not (kept | left) & set(clean_orphans(domain))
            doomed.kill()
            doomed.wait()
            clean_orphans(domain)
            assert kept <= set(os.listdir("/dev/shm"))
            # The living node may have the dead one's files mapped, so only now must they go.
            living.kill()
            living.wait()
            clean_orphans(domain)  # or another run's: ports 7000 and up are shared by all domains
            assert not {name for name in kept | left if "port70" not in name} & set(os.listdir("/dev/shm"))
        finally:
            for node in (living, doomed):
                node.kill()
                node.wait()
                node.communicate()
            clean_orphans(domain)
