"""What is asked before anything of ROS is imported."""

from __future__ import annotations

from robot_formation.extras import require
from robot_formation.network.shared_memory_space import require_space


def require_ros() -> None:
    """Refuse to load ROS where it isn't installed, or where it would end the process.

    Raises:
        MissingExtraError: it isn't installed.
        SharedMemoryError: there is too little shared memory.
    """
    require("ros")
    require_space()
