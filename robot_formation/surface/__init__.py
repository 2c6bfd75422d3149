"""The ground: one file per surface, found by name.

A new surface is a frozen dataclass in a file of its own whose fields are made with `parameter`, with the members of
`Surface`, and one more entry in `SURFACES`. The conformance test runs over all entries. One from another package needs
no entry here (`outside.py`).
"""

from __future__ import annotations

import typing
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from robot_formation import plugins
from robot_formation.json_values import Json
from robot_formation.parameters import check, from_mapping, read_texts, specs
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal, Surface
from robot_formation.surface.bowl import Bowl
from robot_formation.surface.elliptic_bowl import EllipticBowl
from robot_formation.surface.gaussian_bump import GaussianBump
from robot_formation.surface.heightmap import Heightmap
from robot_formation.surface.inclined_plane import InclinedPlane
from robot_formation.surface.outside import make_outside_surface, outside_surface
from robot_formation.surface.plane import Plane
from robot_formation.surface.ripple import Ripple
from robot_formation.surface.saddle import Saddle

__all__ = [
    "PLATE_SIZE_M",
    "SURFACES",
    "Bowl",
    "EllipticBowl",
    "GaussianBump",
    "GradientNormal",
    "Heightmap",
    "InclinedPlane",
    "Plane",
    "Ripple",
    "Saddle",
    "Surface",
    "check_surface_name",
    "make_surface",
    "plate_size",
    "surface_from_texts",
]

_KINDS: tuple[type[Any], ...] = (Bowl, Plane, InclinedPlane, EllipticBowl, Saddle, GaussianBump, Ripple, Heightmap)

SURFACES: Mapping[str, type[Any]] = MappingProxyType({kind.name: kind for kind in _KINDS})
"""Surface classes by name."""


def make_surface(name: str, parameters: Mapping[str, Json] = MappingProxyType({})) -> Surface:
    """Build a surface.

    Args:
        name: a key of `SURFACES`.
        parameters: values for the surface's own parameters; the others keep their defaults.

    Raises:
        ParameterError: on an unknown name or parameter, with the nearest known one, or a value out of range.
    """
    kind = _kind(name)
    if name not in SURFACES:
        return make_outside_surface(name, parameters)
    surface: Surface = from_mapping(kind, parameters, where=f"surface '{name}'")
    return surface


def surface_from_texts(name: str, texts: Sequence[str]) -> Surface:
    """Build a surface from texts like 'height_m=0.1' or 'file=hills.png', the form that a ROS parameter can hold.

    Raises:
        ParameterError: as `make_surface`, and on a text that is no name and value of the parameter's type.
    """
    values = read_texts(_kind(name), texts, where=f"surface '{name}'", example="size_m=2.0")
    return make_surface(name, values)


def plate_size(name: str, texts: Sequence[str] = ()) -> float:
    """Return the edge of a surface's plate, metres, without building the surface if it is one of the package's own.

    Raises:
        ParameterError: as `surface_from_texts`, as far as names and texts go.
    """
    kind = _kind(name)
    values = read_texts(kind, texts, where=f"surface '{name}'", example="size_m=2.0")
    if name not in SURFACES:  # a class from outside may find its size in other ways than by a parameter
        return float(make_surface(name, values).size_m)
    spec = specs(kind)["size_m"]
    return float(typing.cast(float, check(spec, values.get("size_m", spec.default), where=f"surface '{name}'")))


def check_surface_name(name: str) -> None:
    """Check a surface's name; a class from outside the package is not imported for it.

    Raises:
        PluginError: with the nearest known name.
    """
    plugins.check_name("surface", name, SURFACES)


def _kind(name: str) -> type[Any]:
    kind = SURFACES.get(name)
    if kind is not None:
        return kind
    check_surface_name(name)
    return outside_surface(name)
