"""Temporary folders: gone with the run or the bag, and those of a killed process with the next one."""

import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from _io import TextIOWrapper
from pathlib import Path
from typing import Any

import pytest
import zstandard

from robot_formation.bag.qos import TopicQos
from robot_formation.bag.writer import BagWriter
from robot_formation.system.temporary_folder import BAG, RUN, remove_orphans, temporary_folder
from synthetic_bag import STORE, text

STRING = "std_msgs/msg/String"
OWNER = """
import sys
from pathlib import Path
from robot_formation.system.temporary_folder import RUN, temporary_folder
with temporary_folder(RUN, Path(sys.argv[1])) as folder:
    (folder / "world.log").write_text("words")
    print(folder, flush=True)
    sys.stdin.read()
"""

READER = """
import signal, sys
from robot_formation.bag.reader import read_bag
with read_bag(sys.argv[1]):
    print("open", flush=True)
    sys.stdin.read()
"""


def start_owner(parent: Path) -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen(
        [sys.executable, "-c", OWNER, str(parent)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, parent / process.stdout.readline().strip()


def test_the_folder_is_gone_at_the_end(tmp_path: Path) -> None:
    with temporary_folder(RUN, tmp_path) as folder:
        assert folder.is_dir()
        assert folder.parent == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_the_next_run_removes_what_a_killed_one_left_and_never_a_living_ones(tmp_path: Path) -> None:
    killed, left = start_owner(tmp_path)
    living, kept = start_owner(tmp_path)
    with killed, living:
        try:
            assert remove_orphans(tmp_path) == []
            killed.kill()
            killed.wait()
            assert (left / "world.log").exists()
            with temporary_folder(BAG, tmp_path):
                assert not left.exists()
                assert (kept / "world.log").exists()
        finally:
            killed.kill()
            living.kill()


def test_a_folder_that_is_just_being_made_is_left_alone(tmp_path: Path) -> None:
    fresh, old = tmp_path / f"{RUN}fresh", tmp_path / f"{RUN}old"
    fresh.mkdir()
    old.mkdir()
    os.utime(old, (0, 0))
    assert remove_orphans(tmp_path) == [old]
    assert fresh.exists()


def test_links_and_other_folders_stay(tmp_path: Path) -> None:
    target = tmp_path / "precious"
    target.mkdir()
    os.utime(target, (0, 0))
    (tmp_path / f"{RUN}link").symlink_to(target)
    assert remove_orphans(tmp_path) == []
    assert target.exists()


@pytest.mark.parametrize("moment", [1, 2])
def test_a_folder_that_is_taken_for_an_orphan_before_it_is_locked_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: int
) -> None:
    """Another run looks for orphans just before the owner's lock, or finds the lock taken just after it."""
    flock = fcntl.flock
    looked: list[list[Path]] = []

    def look() -> None:
        monkeypatch.setattr(fcntl, "flock", flock)
        looked.append(remove_orphans(tmp_path))

    def delayed(file: TextIOWrapper, operation: int) -> None:
        if moment == 1:
            look()
        flock(file, operation)
        if moment == 2:
            look()

    monkeypatch.setattr(fcntl, "flock", delayed)
    with temporary_folder(RUN, tmp_path) as folder:
        assert list(tmp_path.iterdir()) == [folder]
        assert remove_orphans(tmp_path) == []
        assert [len(removed) for removed in looked] == [1 if moment == 1 else 0]
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_gone_before_it_has_its_lock_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make = tempfile.mkdtemp
    made: list[str] = []

    def removed_at_once(**options: Any) -> str:
        made.append(make(**options))
        if len(made) == 1:
            os.rmdir(made[0])
        return made[-1]

    monkeypatch.setattr(tempfile, "mkdtemp", removed_at_once)
    with temporary_folder(RUN, tmp_path) as folder:
        assert str(folder) == made[1]
        assert folder.is_dir()


def test_a_folder_is_removed_under_its_lock_so_that_no_late_owner_takes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = tmp_path / f"{RUN}old"
    old.mkdir()
    os.utime(old, (0, 0))
    remove = shutil.rmtree
    refused: list[Path] = []

    def watched(folder: Path, **options: Any) -> None:
        with (folder / "owner").open("r+") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                refused.append(folder)
        remove(folder, **options)

    monkeypatch.setattr(shutil, "rmtree", watched)
    assert remove_orphans(tmp_path) == [old]
    assert refused == [old]


def test_what_a_killed_reader_had_unpacked_is_removed_by_the_next_one(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/words", STRING, TopicQos())
        writer.write("/words", bytes(STORE.serialize_cdr(text("hello"), STRING)), 5)
    (file,) = (tmp_path / "bag").glob("*.mcap")
    packed, temporary = tmp_path / f"{file.name}.zstd", tmp_path / "temporary"
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    temporary.mkdir()
    left = []
    for killed in (True, False):
        with subprocess.Popen(
            [sys.executable, "-c", READER, str(packed)],
            env={**os.environ, "TMPDIR": str(temporary)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "open\n"
            (folder,) = temporary.iterdir()
            left.append(folder)
            if killed:
                process.kill()
    assert left[0] != left[1]
    assert list(temporary.iterdir()) == []
