"""A signal that comes while ROS's code waits is told at once, from another thread."""

import subprocess
import sys

import pytest

from graph_lab import DEADLINE_S, Lab

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


EXECUTOR = """
import os, signal, threading, time
from robot_formation.nodes.host.signals import stop_on_signals, stopped, woken_by_signals
stop_on_signals()
import rclpy
from rclpy.signals import SignalHandlerOptions
from robot_formation.nodes.host.component_node import _do_nothing
from robot_formation.nodes.host.executor import make_executor

rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("waiting")
executor = make_executor()
executor.add_node(node)
executor.spin_once(0.1)
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM)).start()
with woken_by_signals(lambda: executor.create_task(_do_nothing)):
    while not stopped():
        executor.spin_once(3600.0)
os._exit(0)
"""


@pytest.mark.graph
def test_a_waiting_executor_returns_when_a_signal_comes(lab: Lab) -> None:
    process = lab.open([sys.executable, "-c", EXECUTOR], lab.environment)
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, errors
