""".ci/run with stand-ins for what it calls: exit codes, and processes that a part leaves."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from repository import ROOT


def copy_of_the_script(folder: Path, tests: str, lowest: str = "exit 0") -> list[str]:
    """Put the script and stand-ins into a folder; return its command."""
    (folder / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "run", folder / ".ci" / "run")
    for name, body in (("formation", tests), (".ci/lowest", lowest), (".ci/same_runs", "echo same")):
        (folder / name).write_text(f"#!/bin/bash\n{body}\n")
        (folder / name).chmod(0o755)
    return ["bash", str(folder / ".ci" / "run")]


def test_all_parts_run_and_failures_are_named_at_the_end(tmp_path: Path) -> None:
    command = copy_of_the_script(
        tmp_path, "echo 'FAILED test/test_a.py'; exit 3", "echo 'ERROR test_b.py' >&2; exit 124"
    )
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stdout.partition("failed: ")[2].splitlines() == [
        "tests, newest versions",
        "failed: tests, lowest versions (not done within 28 minutes)",
        "FAILED test/test_a.py",
        "ERROR test_b.py",
    ]
    assert "same\n" in done.stdout


def test_the_exit_code_is_zero_if_all_passed(tmp_path: Path) -> None:
    done = subprocess.run(copy_of_the_script(tmp_path, "exit 0"), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("\nall passed\n")


@pytest.mark.long
def test_a_process_that_a_part_leaves_does_not_keep_the_output_open(tmp_path: Path) -> None:
    command = copy_of_the_script(tmp_path, "setsid sleep 600 & echo $! >left")
    try:
        done = subprocess.run(command, capture_output=True, text=True)
        os.kill(int((tmp_path / "left").read_text()), 0)  # it still runs
    finally:
        os.kill(int((tmp_path / "left").read_text()), signal.SIGKILL)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("\nall passed\n")
