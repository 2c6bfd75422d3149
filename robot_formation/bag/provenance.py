"""What recorded a bag: versions of the software."""

from __future__ import annotations

import platform
from importlib import metadata

import robot_formation

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
