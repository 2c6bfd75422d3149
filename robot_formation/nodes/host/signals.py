"""Signals that ask a node to end, as a flag that is set up before ROS is loaded: none interrupts an import."""

from __future__ import annotations

import signal
import sys

from robot_formation import exit_codes
from robot_formation.network.shared_memory_space import SharedMemoryError, require_space
from robot_formation.system.signal_handling import ENDING, SignalCounter

_signals = SignalCounter()


def stop_on_signals() -> None:
    """Let SIGINT, SIGTERM and SIGHUP set a flag that the main loops look at (SIGHUP only if nobody ignores it).

    Ends the process where ROS can't be loaded.
    """
    _signals.install()
    try:
        require_space()
    except SharedMemoryError as error:
        print(error, file=sys.stderr)
        raise SystemExit(exit_codes.BAD_INPUT) from None


def ignore_signals() -> None:
    """Let no further signal kill this process, whose work is done: while Python ends it restores the default actions
    of all signals but those that are ignored.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def stopped() -> bool:
    """Return whether a signal has asked this process to end."""
    return _signals.came()
