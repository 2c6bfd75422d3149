"""The ground: one file per surface, found by name.

A new surface is a frozen dataclass in a file of its own whose fields are made with `parameter`, with the members of
`Surface`, and one more entry in `SURFACES`. The conformance test runs over all entries.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from robot_formation.parameters import ParameterError, from_mapping, suggestion
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal, Surface
from robot_formation.surface.bowl import Bowl
from robot_formation.surface.plane import Plane

__all__ = ["PLATE_SIZE_M", "SURFACES", "Bowl", "GradientNormal", "Plane", "Surface", "make_surface"]

_KINDS: tuple[type[Any], ...] = (Bowl, Plane)

SURFACES: Mapping[str, type[Any]] = MappingProxyType({kind.name: kind for kind in _KINDS})
"""Surface classes by name."""


def make_surface(name: str, parameters: Mapping[str, float] = MappingProxyType({})) -> Surface:
    """Build a surface.

    Args:
        name: a key of `SURFACES`.
        parameters: values for the surface's own parameters; the others keep their defaults.

    Raises:
        ParameterError: on an unknown name or parameter, with the nearest known one, or a value out of range.
    """
    kind = SURFACES.get(name)
    if kind is None:
        raise ParameterError(f"no surface '{name}'{suggestion(name, SURFACES)}")
    surface: Surface = from_mapping(kind, parameters, where=f"surface '{name}'")
    return surface
