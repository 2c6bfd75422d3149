"""The leader's paths: one file per family, found by name.

A new path is a frozen dataclass in a file of its own, derived from `PathKind`, whose fields are made with `parameter`,
and one more entry in `PATHS`. The conformance test runs over all entries. One from another package needs no entry here
(`outside.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from robot_formation import plugins
from robot_formation.json_values import Json
from robot_formation.leader.paths.arc import Arc
from robot_formation.leader.paths.base import Given, LeaderPath, PathKind, Room, poses
from robot_formation.leader.paths.circle import Circle
from robot_formation.leader.paths.clothoid import Clothoid
from robot_formation.leader.paths.figures import Lemniscate, Lissajous
from robot_formation.leader.paths.outside import outside_path
from robot_formation.leader.paths.random_walk import RandomWalk
from robot_formation.leader.paths.speeds import Chirp, SpeedStep, Stop
from robot_formation.leader.paths.stadium import Stadium
from robot_formation.leader.paths.straight import Straight
from robot_formation.leader.paths.switch import Switch
from robot_formation.leader.paths.teleop import Teleop
from robot_formation.leader.paths.waves import Pulse, Slalom
from robot_formation.leader.paths.waypoints import Waypoints
from robot_formation.parameters import ParameterError, from_mapping, read_texts, specs, suggestion

__all__ = [
    "PATHS",
    "Given",
    "LeaderPath",
    "PathKind",
    "Room",
    "Teleop",
    "check_path_name",
    "make_path",
    "path_kind",
    "poses",
]

_KINDS: tuple[type[PathKind], ...] = (
    *(Straight, Circle, Arc, Slalom, Pulse, SpeedStep, Stop, Chirp, Lemniscate, Lissajous, Stadium, Clothoid),
    *(Switch, RandomWalk, Waypoints, Teleop),
)

PATHS: Mapping[str, type[PathKind]] = MappingProxyType({kind.name: kind for kind in _KINDS})
"""Families of paths by name."""


_NOTHING = Given()


def check_path_name(name: str) -> None:
    """Check a path's name; a class from outside the package is not imported for it.

    Raises:
        PluginError: with the nearest known name.
    """
    plugins.check_name("path", name, PATHS)


def path_kind(name: str) -> type[PathKind]:
    """Return the family of this name.

    Raises:
        ParameterError: if there is none, with the nearest known one.
    """
    kind = PATHS.get(name)
    if kind is not None:
        return kind
    check_path_name(name)
    return outside_path(name)


def make_path(name: str, texts: Sequence[str] = (), given: Given = _NOTHING) -> LeaderPath:
    """Build a path from texts like 'period=12', the form that a ROS parameter can hold.

    Args:
        name: a key of `PATHS`.
        texts: values for the path's own parameters; the others keep their defaults. One like 'circle.period=12' is for
            that path alone, so that several paths can share texts.
        given: the leader's step and seed, and the room that it has.

    Raises:
        ParameterError: on an unknown name or parameter, with the nearest known one, or a value that can't be used.
    """
    kind, where = path_kind(name), f"path '{name}'"
    known = specs(kind)
    own, of_parts = _sorted_by_owner(name, texts)
    values: dict[str, Json] = read_texts(kind, own, where=where, example="period=12")
    if "step_m" in known:
        values.setdefault("step_m", given.step_m)
    if "phase" in known:
        values.setdefault("phase", float(given.random("phase").random()))
    if name not in PATHS:
        outside = plugins.build("path", name, kind, values)
        with plugins.guarded("path", name, "'prepared'"):
            return outside.prepared(given)
    made = from_mapping(kind, values, where=where)
    if isinstance(made, Switch):
        return made.joined(given, of_parts, make_path)
    return made.prepared(given)


def _sorted_by_owner(name: str, texts: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return a path's own texts, and the values by name of those that belong to other paths.

    Raises:
        ParameterError: if a text is for a path or parameter that doesn't exist, or no value, or given twice.
    """
    own: list[str] = []
    others: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        owner, dot, parameter_name = key.strip().partition(".")
        if not dot:
            own.append(text)
            continue
        known = specs(path_kind(owner))
        if parameter_name not in known:
            hint = suggestion(parameter_name, known)
            raise ParameterError(f"path '{owner}': no parameter '{parameter_name}'{hint}")
        if not equals or key.strip() in others:
            raise ParameterError(f"path '{owner}': give '{parameter_name}' once, like {key.strip()}=12")
        if path_kind(owner) is path_kind(name):
            own.append(f"{parameter_name}={value}")
        else:
            others[key.strip()] = value.strip()
    return own, others
