"""Paths from outside the package: a class with `motion`, and what it leaves out."""

from __future__ import annotations

from functools import cache
from typing import Any

from robot_formation import plugins
from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import PathKind

KIND = "path"


def outside_path(name: str) -> type[PathKind]:
    """Import the family of paths of this name, and complete it.

    Raises:
        PluginError: if it can't be imported, or is no path.
    """
    return _completed(name, plugins.load(KIND, name))


@cache
def _completed(name: str, kind: type) -> type[PathKind]:
    return completed_path(name, kind)


def completed_path(name: str, kind: type[Any]) -> type[PathKind]:
    """Return a class with all members of `PathKind`, as a frozen dataclass.

    What the class needs is `motion(timestep)`, which returns a `Motion`, or two or three numbers: x forward and y left
    in metres, yaw in radians. It must be a pure function of the timestep and the parameters, which are the class's
    fields, if it is a frozen dataclass. Fields `step_m` and `phase` that aren't set are the leader's, and the seed's.

    Raises:
        PluginError: if it has no such form.
    """

    def motion(self: PathKind, timestep: int) -> Motion:
        """See `LeaderPath`."""
        try:
            found = kind.motion(self, timestep)
            motion = found if isinstance(found, Motion) else Motion(*(float(part) for part in found))
        except plugins.FAILURES as error:
            raise plugins.failed(KIND, name, f"the motion of timestep {timestep}", error) from error
        if not motion.finite:
            raise plugins.PluginError(f"{KIND} '{name}': the motion of timestep {timestep} is not finite")
        return motion

    members = {"motion": motion} if callable(getattr(kind, "motion", None)) else {}
    found: type[PathKind] = plugins.completed(KIND, name, kind, needs="motion", base=PathKind, members=members)
    return found
