"""Libraries work in the thread that calls them, unless the user has chosen otherwise."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robot_formation.launching.environment import node_environment
from robot_formation.system.threads import one_thread

NAMES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
WITHOUT = {name: value for name, value in os.environ.items() if name not in NAMES}
COUNTED = """
import os, sys
from robot_formation.system.threads import one_thread
os.environ.update(one_thread(os.environ))
import cv2, numpy as np
large = np.ones((1200, 1200))
large @ large
cv2.GaussianBlur(np.ones((2000, 2000), np.float32), (31, 31), 9.0)
print(cv2.getNumThreads(), len(os.listdir("/proc/self/task")))
"""
# Tells the variables when a process begins to import numpy.
HOOK = f"""
import os, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "numpy":
            sys.meta_path.remove(self)
            print([os.environ.get(name) for name in {NAMES}], file=sys.stderr)
sys.meta_path.insert(0, Finder())
"""


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ({}, "1111"),
        ({"OMP_NUM_THREADS": "3"}, "3333"),
        ({"OMP_NUM_THREADS": "3", "OPENBLAS_NUM_THREADS": "2"}, "3233"),
        ({"OPENCV_FOR_THREADS_NUM": "4"}, "1114"),
    ],
)
def test_the_users_choice_counts(chosen: dict[str, str], expected: str) -> None:
    assert one_thread(chosen) == dict(zip(NAMES, expected, strict=True))


def test_the_libraries_start_no_thread() -> None:
    command = [sys.executable, "-c", COUNTED]
    done = subprocess.run(command, env=WITHOUT, capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.split() == ["1", "1"]


def test_nodes_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    environment = node_environment(42, tmp_path)
    assert [environment[name] for name in NAMES] == ["1"] * 4


def test_the_command_line_says_it_before_numpy_is_imported(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(HOOK)
    command = [sys.executable, "-m", "robot_formation.cli", "run", "--track", "nowhere"]
    environment = {**WITHOUT, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == str(["1"] * 4)
