"""The signals that ask a process to end in good order, and handlers for them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from types import FrameType
from typing import Any

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""The signals: of Ctrl-C, of `kill`, and of a terminal that is closed."""


def take(handler: Callable[[int, FrameType | None], None]) -> dict[signal.Signals, Any]:
    """Install a handler for the signals; SIGHUP stays ignored where it is, as under `nohup`.

    Returns:
        The handlers before, of the signals that were taken; for `give_back`.
    """
    hangup_is_ignored = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    taken = [number for number in ENDING if number != signal.SIGHUP or not hangup_is_ignored]
    return {number: signal.signal(number, handler) for number in taken}


def give_back(previous: Mapping[signal.Signals, Any]) -> None:
    """Install the handlers again that `take` has replaced."""
    for number, handler in previous.items():
        signal.signal(number, handler)
