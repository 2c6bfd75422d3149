"""What recorded a bag: versions of the software, and the commit where it runs from a checkout."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata

import robot_formation
from robot_formation.paths import project_root

PACKAGES = ("numpy", "pybullet", "opencv-python-headless", "mcap", "rosbags")


def versions() -> dict[str, str]:
    """List the versions of this package, Python and the libraries that a run's results depend on."""
    found = {"robot_formation": robot_formation.__version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not from pip"
    return found


def git_commit() -> str:
    """Return the checkout's commit, with `-dirty` behind it if files have been changed; empty without one."""
    root = project_root()
    if root is None:
        return ""
    command = ["git", "-C", str(root), "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return result.stdout.strip() if result.returncode == 0 else ""
