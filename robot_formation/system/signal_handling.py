"""The signals that ask a process to end in good order, and handlers for them."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from types import FrameType, TracebackType
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


class SignalCounter:
    """Counts the signals, so that work ends in good order; a context manager.

    Attributes:
        count: how many have come.
    """

    def __init__(self, patience: int | None = None) -> None:
        """Make a counter; after `patience` signals each further one raises KeyboardInterrupt (None: none does)."""
        self.count = 0
        self._patience = patience
        self._before: dict[signal.Signals, Any] = {}

    def install(self) -> None:
        """Count from now on, also where nothing gives the signals back."""
        self._before = take(self._take)

    def came(self) -> bool:
        """Return whether a signal has come."""
        return self.count > 0

    def __enter__(self) -> SignalCounter:
        self.install()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        give_back(self._before)

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if self._patience is not None and self.count > self._patience:
            raise KeyboardInterrupt
