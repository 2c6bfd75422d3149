"""SIGINT and SIGTERM as a flag, set up before anything of ROS is loaded: a signal never interrupts an import."""

from __future__ import annotations

import signal
from typing import Any

_stop = False


def stop_on_signals() -> None:
    """Let SIGINT and SIGTERM set a flag that the main loops look at."""

    def handler(number: int, frame: Any) -> None:
        global _stop
        _stop = True

    signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGTERM, handler)


def stopped() -> bool:
    """Tell whether a signal has asked this process to end."""
    return _stop
