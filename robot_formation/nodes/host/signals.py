"""Signals that ask a node to end, as a flag that is set up before ROS is loaded: none interrupts an import."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator

from robot_formation import exit_codes
from robot_formation.errors import FormationError
from robot_formation.network.loading_ros import require_ros
from robot_formation.system.signal_handling import ENDING, SignalCounter

_LONGEST_END_S = 20
"""Longer than a launcher waits before it kills (15 s)."""
_signals = SignalCounter()
_launcher: int | None = None


def stop_on_signals() -> None:
    """Let SIGINT, SIGTERM and SIGHUP set a flag that the main loops look at (SIGHUP only if nobody ignores it).

    Ends the process where ROS can't be loaded.
    """
    _signals.install()
    try:
        require_ros()
    except FormationError as error:
        print(error, file=sys.stderr)
        raise SystemExit(exit_codes.BAD_INPUT) from None


def ignore_signals() -> None:
    """Let no further signal kill this process, whose work is done: while Python ends it restores the default actions
    of all signals but those that are ignored.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def bounded_end(longest_s: int = _LONGEST_END_S) -> Iterator[None]:
    """Let the kernel end this process if what is inside takes longer than so many seconds.

    Fast DDS sometimes never returns from destroying a node, at full load and with Python's lock held, so that no signal
    handler runs any more. A node whose launcher is gone has nobody who would kill it then.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(longest_s)
    try:
        yield
    finally:
        signal.alarm(0)


def stopped() -> bool:
    """Return whether a signal has asked this process to end."""
    return _signals.came()


@contextlib.contextmanager
def woken_by_signals(wake: Callable[[], object]) -> Iterator[None]:
    """Call `wake`, from a thread of its own, whenever a signal comes while what is inside runs.

    A signal doesn't end a wait in ROS's code, and Python's handler runs only after that wait. Looking for signals every
    30 ms instead costs a hundredth of a processor per node.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    thread = threading.Thread(target=_wake_for_each, args=(reading, wake))
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(writing)
        thread.join()
        os.close(reading)


def _wake_for_each(reading: int, wake: Callable[[], object]) -> None:
    while os.read(reading, 1):
        wake()


def end_without_farewell(launcher: int) -> None:
    """Let this process end without leaving the graph first, as long as its launcher lives.

    For a run of many nodes, which ends with the first of them: each would tell all others of the end of each of its
    publishers and subscribers, and Fast DDS may deadlock meanwhile (its issue 6502). Nobody is left to hear it but
    programs that the user has started, which list the nodes for 20 s more. The launcher removes what is left in shared
    memory.

    Args:
        launcher: its process id.
    """
    global _launcher
    _launcher = launcher


def says_farewell() -> bool:
    """Return whether this process leaves the graph before it ends."""
    return _launcher != os.getppid()
