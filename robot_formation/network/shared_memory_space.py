"""Whether shared memory has room for what ROS puts there as soon as it is loaded.

ROS's tracing library maps two pages of /dev/shm and writes to them. With no room for them the kernel ends the process
by SIGBUS, which nothing can catch; so this is asked before anything of ROS is imported. The middleware itself asks the
system for its room, and does without where there is none.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robot_formation.errors import FormationError

SHARED_MEMORY = Path("/dev/shm")
LEAST_FREE_BYTES = 32 * 1024


class SharedMemoryError(FormationError):
    """Shared memory is full."""


def require_space(folder: Path = SHARED_MEMORY, statvfs: Callable[[Path], Any] = os.statvfs) -> None:
    """Refuse to load ROS while shared memory is full. A folder that is missing or can't be written to is no obstacle.

    Args:
        folder: where shared memory lies.
        statvfs: asks for the state of its file system.

    Raises:
        SharedMemoryError: there is too little room.
    """
    try:
        state = statvfs(folder)
    except OSError:
        return
    if state.f_flag & os.ST_RDONLY:
        return
    free = state.f_bavail * state.f_frsize
    if free < LEAST_FREE_BYTES:
        size_mb = state.f_blocks * state.f_frsize / 1e6
        raise SharedMemoryError(
            f"{folder} is full ({free // 1024} kB of {size_mb:.3g} MB are free), and ROS can't be loaded without: "
            f"remove what nobody uses ('ls -l {folder}'), or make it larger ('mount -o remount,size=64M {folder}')"
        )
