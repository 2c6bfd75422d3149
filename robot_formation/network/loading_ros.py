"""What is done before anything of ROS is imported."""

from __future__ import annotations

import contextlib
import importlib
import sys

from robot_formation.extras import require
from robot_formation.network.shared_memory_space import require_space

_SUPPORT = "rosidl_generator_py"
_GENERATOR = f"{_SUPPORT}.generate_py_impl"


def require_ros() -> None:
    """Refuse to load ROS where it isn't installed, or where it would end the process.

    Raises:
        MissingExtraError: it isn't installed.
        SharedMemoryError: there is too little shared memory.
    """
    require("ros")
    require_space()
    _load_support_of_messages()


def _load_support_of_messages() -> None:
    """Import what every message needs, without the generator of messages' code.

    The package that loads messages' libraries imports the generator too, with its parser, and does without where it
    can't: 6.5 MB and 0.03 s in each process.
    """
    if _SUPPORT in sys.modules:
        return
    sys.modules[_GENERATOR] = None  # type: ignore[assignment]  # as if it were not installed
    with contextlib.suppress(ImportError):
        importlib.import_module(_SUPPORT)
    del sys.modules[_GENERATOR]
