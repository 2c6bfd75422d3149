"""Libraries work in the thread that calls them, unless the user has chosen otherwise."""

import subprocess
import sys

from robot_formation.system.threads import use_one_thread

COUNTED = """
import os, sys
from robot_formation.system.threads import use_one_thread
use_one_thread(os.environ)
import cv2, numpy as np
large = np.ones((1200, 1200))
large @ large
cv2.GaussianBlur(np.ones((2000, 2000), np.float32), (31, 31), 9.0)
print(cv2.getNumThreads(), len(os.listdir("/proc/self/task")))
"""


def test_the_users_choice_stays() -> None:
    environment = {"OMP_NUM_THREADS": "3", "HOME": "/somewhere"}
    use_one_thread(environment)
    assert environment["OMP_NUM_THREADS"] == "3"
    assert environment["HOME"] == "/somewhere"
    assert environment["OPENBLAS_NUM_THREADS"] == "1"


def test_the_libraries_start_no_thread() -> None:
    done = subprocess.run([sys.executable, "-c", COUNTED], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.split() == ["1", "1"]
