"""A full /dev/shm is told in one line, before ROS is loaded and ended by the kernel."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from cli_tools import complaint
from robot_formation.cli.main import main
from robot_formation.network.shared_memory_space import SharedMemoryError, require_space


def file_system(free: int, flags: int = 0, size: int = 64 << 20) -> Callable[[object], SimpleNamespace]:
    return lambda folder: SimpleNamespace(f_bavail=free // 4096, f_frsize=4096, f_blocks=size // 4096, f_flag=flags)


def test_a_full_one_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(SharedMemoryError) as error:
        require_space(tmp_path, file_system(4096))
    assert str(tmp_path) in str(error.value)
    assert "4 kB of 67.1 MB are free" in str(error.value)
    assert "remount" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("state", [file_system(64 << 10, size=64 << 10), file_system(0, os.ST_RDONLY)])
def test_a_small_one_and_a_read_only_one_will_do(tmp_path: Path, state: Callable[[object], SimpleNamespace]) -> None:
    require_space(tmp_path, state)


def test_none_at_all_will_do(tmp_path: Path) -> None:
    require_space(tmp_path / "missing")


def full(folder: object = None, statvfs: object = None) -> None:
    raise SharedMemoryError("/dev/shm is full")


@pytest.mark.parametrize("arguments", [("record", "-a"), ("play", "bag")])
def test_verbs_that_load_ros_say_it_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, str]
) -> None:
    monkeypatch.setattr("robot_formation.network.loading_ros.require_space", full)
    assert "/dev/shm is full" in complaint(capsys, *arguments)


def test_the_doctor_names_it_and_does_not_load_ros(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robot_formation.cli.doctor.require_space", full)
    assert main(["doctor"]) == 2
    assert "a run cannot start: /dev/shm is full" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (["-m", "robot_formation.cli", "run", "--in-process"], 2),
        (["-m", "robot_formation.nodes", "leader"], 2),
    ],
)
def test_processes_end_by_it_before_ros_is_loaded(tmp_path: Path, command: list[str], code: int) -> None:
    # The check is made to fail where Python starts, since filling /dev/shm would hit everybody.
    (tmp_path / "sitecustomize.py").write_text(
        "from robot_formation.network import shared_memory_space as space\nspace.LEAST_FREE_BYTES = 1 << 62\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    completed = subprocess.run([sys.executable, *command], env=environment, capture_output=True, text=True, check=False)
    assert completed.returncode == code
    assert "/dev/shm is full" in completed.stderr
    assert len(completed.stderr.strip().splitlines()) == 1
