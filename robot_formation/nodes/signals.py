"""Signals that ask a node to end, as a flag that is set up before ROS is loaded: none interrupts an import."""

from __future__ import annotations

import signal
from typing import Any

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_stop = False


def stop_on_signals() -> None:
    """Let SIGINT, SIGTERM and SIGHUP set a flag that the main loops look at (SIGHUP only if nobody ignores it)."""

    def handler(number: int, frame: Any) -> None:
        global _stop
        _stop = True

    for number in _NUMBERS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def ignore_signals() -> None:
    """Let no further signal kill this process, whose work is done: while Python ends it restores the default actions
    of all signals but those that are ignored.
    """
    for number in _NUMBERS:
        signal.signal(number, signal.SIG_IGN)


def stopped() -> bool:
    """Tell whether a signal has asked this process to end."""
    return _stop
