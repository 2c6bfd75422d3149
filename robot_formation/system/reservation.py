"""Names that one process of this machine has at a time."""

from __future__ import annotations

import errno
import socket


def reserve(name: str) -> socket.socket | None:
    """Reserve a name by an abstract Unix socket: reserved in one step, gone with its process, and no file is left.

    Returns:
        What keeps the name until it is closed; None if another has it.

    Raises:
        OSError: if this system doesn't let names be reserved.
    """
    taken = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        taken.bind(f"\0robot_formation_{name}")
    except OSError as error:
        taken.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return None
    return taken
