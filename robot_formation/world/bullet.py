"""PyBullet. It prints a build banner to standard error when it is imported, which is suppressed."""

from __future__ import annotations

from robot_formation.extras import require
from robot_formation.system.standard_error import silent_stderr

require("sim")
with silent_stderr():
    import pybullet

__all__ = ["pybullet"]
