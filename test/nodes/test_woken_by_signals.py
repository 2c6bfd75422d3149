"""A signal that comes while ROS's code waits is told at once, from another thread."""

import subprocess
import sys

PROGRAM = """
import os, signal, threading
from robot_formation.nodes.host.signals import woken_by_signals

came, woken = [], threading.Semaphore(0)
signal.signal(signal.SIGTERM, lambda number, frame: came.append(number))
with woken_by_signals(woken.release):
    for _ in range(2):
        os.kill(os.getpid(), signal.SIGTERM)
        assert woken.acquire(timeout=60)
assert came == [signal.SIGTERM] * 2
os.kill(os.getpid(), signal.SIGTERM)
assert not woken.acquire(blocking=False)
assert threading.active_count() == 1
assert signal.set_wakeup_fd(-1) == -1
"""


def test_every_signal_wakes_while_it_is_asked_for_and_nothing_is_left() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], timeout=120, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
