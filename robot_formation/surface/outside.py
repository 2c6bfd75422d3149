"""Surfaces from outside the package: a class with `height`, and what it leaves out."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_formation import plugins
from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal

KIND = "surface"
_DIFFERENCE_M = 1e-5


class _Heights(GradientNormal):
    """What a surface has by default, after its height."""

    def height(self, x: float, y: float) -> float:
        """Height above the world's origin, metres."""
        raise NotImplementedError

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes by central differences; exact to about 1e-10."""
        d = _DIFFERENCE_M
        along_x = (float(self.height(x + d, y)) - float(self.height(x - d, y))) / (2.0 * d)
        along_y = (float(self.height(x, y + d)) - float(self.height(x, y - d))) / (2.0 * d)
        return along_x, along_y

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights at arrays of places, one after the other."""
        return np.asarray(np.vectorize(self.height, otypes=[float])(xs, ys))


@cache
def outside_surface(name: str) -> type[Any]:
    """Import the surface class of this name, and complete it.

    Raises:
        PluginError: if it can't be imported, or is no surface.
    """
    return completed_surface(name, plugins.load(KIND, name))


def completed_surface(name: str, kind: type) -> type[Any]:
    """Return a class with all members of `Surface`, as a frozen dataclass.

    What the class needs is `height(x, y)`; `gradient`, `normal`, `heights` and `size_m` have defaults. Its parameters
    are its fields, if it is a frozen dataclass.

    Raises:
        PluginError: if it has no such form.
    """
    fields = {field.name for field in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    members: dict[str, object] = {}
    size_m = getattr(kind, "size_m", PLATE_SIZE_M)
    if plugins.has_constructor(kind):
        members["size_m"] = size_m
    elif "size_m" not in fields:
        members["__annotations__"] = {"size_m": float}
        members["size_m"] = parameter(size_m, "edge of the square plate", unit="m", low=0.1, high=100.0)
    return plugins.completed(KIND, name, kind, needs="height", base=_Heights, members=members)
