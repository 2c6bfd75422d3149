"""SIGINT and SIGTERM as a flag, set up before anything of ROS is loaded: a signal never interrupts an import."""

from __future__ import annotations

import signal
import sys
from typing import Any

from robot_formation import exit_codes
from robot_formation.shared_memory_space import SharedMemoryError, require_space

_stop = False


def stop_on_signals() -> None:
    """Let SIGINT and SIGTERM set a flag that the main loops look at. Ends the process where ROS can't be loaded."""

    def handler(number: int, frame: Any) -> None:
        global _stop
        _stop = True

    signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGTERM, handler)
    try:
        require_space()
    except SharedMemoryError as error:
        print(error, file=sys.stderr)
        raise SystemExit(exit_codes.BAD_INPUT) from None


def stopped() -> bool:
    """Tell whether a signal has asked this process to end."""
    return _stop
