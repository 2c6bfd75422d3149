"""Where the package's files lie: in a source checkout, or under the prefix that it was installed to."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from robot_formation.errors import FormationError

_PACKAGE = Path(__file__).resolve().parent


def project_root() -> Path | None:
    """Find the source checkout that this code runs from; None where it was installed without one."""
    root = _PACKAGE.parent
    return root if (root / "package.xml").is_file() and (root / "setup.py").is_file() else None


def share_dir() -> Path:
    """Find the folder that holds config/ and launch/: the checkout's root, else PREFIX/share/robot_formation.

    Raises:
        FormationError: if no installed prefix has it.
    """
    for candidate in _candidates():
        if (candidate / "config").is_dir():
            return candidate
    raise FormationError(
        "the package's config folder was not found: install robot_formation again with pip or colcon, "
        "or add its prefix to AMENT_PREFIX_PATH"
    )


def config_dir() -> Path:
    """Find the folder of parameter files and presets.

    Raises:
        FormationError: if the package was installed without it.
    """
    return share_dir() / "config"


def default_bags_dir() -> Path:
    """Return where runs are written by default: the checkout's bags/, else ./bags (may not exist yet)."""
    return (project_root() or Path.cwd()) / "bags"


def default_calibrations_dir() -> Path:
    """Return where calibrations are written by default: the checkout's calibrations/, else ./calibrations."""
    return (project_root() or Path.cwd()) / "calibrations"


def _candidates() -> Iterator[Path]:
    """List where share_dir may be, nearest first."""
    root = project_root()
    if root is not None:
        yield root
    # The prefix this code was installed to is one of its parents, whatever lies between (lib, local/lib, ...).
    prefixes = [*_PACKAGE.parents, Path(sys.prefix)]
    prefixes += [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    for prefix in prefixes:
        yield prefix / "share" / "robot_formation"
