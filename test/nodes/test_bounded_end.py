"""A node whose middleware never lets go of it ends all the same."""

import signal
import subprocess
import sys

IMPORT = "import ctypes, signal; from robot_formation.nodes.host.signals import bounded_end\n"


def code_of(program: str) -> int:
    return subprocess.run([sys.executable, "-c", IMPORT + program], timeout=60, check=False).returncode


def test_what_holds_pythons_lock_for_ever_is_ended() -> None:
    # PyDLL keeps the lock, as destroying a node does: no handler in Python can run.
    program = "with bounded_end(1):\n    ctypes.PyDLL(None).sleep(1000)\n"
    assert code_of(program) == -signal.SIGALRM


def test_what_ends_in_time_is_left_alone() -> None:
    program = "with bounded_end(1000):\n    pass\nassert signal.alarm(0) == 0\n"
    assert code_of(program) == 0
