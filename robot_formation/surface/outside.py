"""Surfaces from outside the package: a class with `height`, and what it leaves out."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_formation import plugins
from robot_formation.errors import shown
from robot_formation.json_values import Json
from robot_formation.parameters import parameter
from robot_formation.surface.base import PLATE_SIZE_M, GradientNormal, Surface

KIND = "surface"
_LEAST_SIZE_M, _MOST_SIZE_M = 0.1, 100.0
_DIFFERENCE_M = 1e-5


class _Heights(GradientNormal):
    """What a surface has by default, after its height."""

    def height(self, x: float, y: float) -> float:
        """Height above the world's origin, metres."""
        raise NotImplementedError

    def gradient(self, x: float, y: float) -> tuple[float, float]:
        """Slopes by central differences; exact to about 1e-10."""
        d = _DIFFERENCE_M
        along_x = (self.height(x + d, y) - self.height(x - d, y)) / (2.0 * d)
        along_y = (self.height(x, y + d) - self.height(x, y - d)) / (2.0 * d)
        return along_x, along_y

    def heights(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights at arrays of places, one after the other."""
        return np.asarray(np.vectorize(self.height, otypes=[float])(xs, ys))


def outside_surface(name: str) -> type[Any]:
    """Import the surface class of this name, and complete it.

    Raises:
        PluginError: if it can't be imported, or is no surface.
    """
    return _completed(name, plugins.load(KIND, name))


@cache
def _completed(name: str, kind: type) -> type[Any]:
    return completed_surface(name, kind)


def make_outside_surface(name: str, parameters: Mapping[str, Json]) -> Surface:
    """Build a surface of a class from outside.

    Raises:
        ParameterError: on an unknown parameter, or a value that the class or this package refuses.
    """
    surface: Surface = plugins.build(KIND, name, outside_surface(name), parameters)
    check_size(name, surface)
    return surface


def check_size(name: str, surface: Surface) -> None:
    """Check the edge of a surface's plate.

    Raises:
        PluginError: if it is no number within the limits of the package's own surfaces.
    """
    try:
        size_m: object = surface.size_m
    except plugins.FAILURES as error:
        raise plugins.failed(KIND, name, "'size_m'", error) from error
    number = isinstance(size_m, (int, float)) and not isinstance(size_m, bool)
    if not (number and _LEAST_SIZE_M <= size_m <= _MOST_SIZE_M):  # type: ignore[operator]
        raise plugins.PluginError(
            f"{KIND} '{name}': 'size_m' is {shown(size_m)}; it must be a number of metres, "
            f"{_LEAST_SIZE_M:g} to {_MOST_SIZE_M:g}"
        )


def completed_surface(name: str, kind: type) -> type[Any]:
    """Return a class with all members of `Surface`, as a frozen dataclass.

    What the class needs is `height(x, y)`; `gradient`, `normal`, `heights` and `size_m` have defaults. Its parameters
    are its fields, if it is a frozen dataclass.

    Raises:
        PluginError: if it has no such form.
    """
    fields = {field.name for field in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    members = _checked_members(name, kind)
    size_m = getattr(kind, "size_m", PLATE_SIZE_M)
    if plugins.has_constructor(kind):
        members["size_m"] = size_m
    elif "size_m" not in fields and not isinstance(size_m, property):
        members["__annotations__"] = {"size_m": float}
        members["size_m"] = parameter(
            size_m, "edge of the square plate", unit="m", low=_LEAST_SIZE_M, high=_MOST_SIZE_M
        )
    found: type[Any] = plugins.completed(KIND, name, kind, needs="height", base=_Heights, members=members)
    check_size(name, found())
    return found


def _checked_members(name: str, kind: type[Any]) -> dict[str, object]:
    """Wrap a class's own methods: if they fail or return something wrong, that is a PluginError."""

    def heights(self: Any, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface`."""
        with plugins.guarded(KIND, name, "'heights'"):
            found = np.asarray(kind.heights(self, xs, ys), dtype=float)
            expected = np.broadcast_shapes(np.shape(xs), np.shape(ys))
            if found.shape != expected:
                raise ValueError(f"an array of shape {expected} is expected, not {found.shape}")
            if not np.isfinite(found).all():
                raise ValueError("not all heights are finite")
        return found

    members = {
        "height": _at_place(name, "height", kind, _number),
        "gradient": _at_place(name, "gradient", kind, partial(_vector, 2)),
        "normal": _at_place(name, "normal", kind, partial(_vector, 3)),
        "heights": heights,
    }
    inherited = (None, GradientNormal.gradient, GradientNormal.normal)
    return {method: member for method, member in members.items() if getattr(kind, method, None) not in inherited}


def _at_place(name: str, method: str, kind: type[Any], converted: Callable[[Any], Any]) -> Callable[..., Any]:
    """Wrap a class's own method of a place; it is called many times, therefore without a context manager."""
    own = getattr(kind, method, None)

    def checked(self: Any, x: float, y: float) -> Any:
        """See `Surface`."""
        try:
            return converted(own(self, x, y))  # type: ignore[misc]
        except plugins.PluginError:
            raise
        except plugins.FAILURES as error:
            raise plugins.failed(KIND, name, f"the {method} at ({x:g}, {y:g})", error) from error

    return checked


def _number(found: Any) -> float:
    number = float(found)
    if not math.isfinite(number):
        raise ValueError(f"{number} is not finite")
    return number


def _vector(length: int, found: Any) -> tuple[float, ...]:
    numbers = tuple(_number(part) for part in found)
    if len(numbers) != length:
        raise ValueError(f"{length} numbers are expected, not {len(numbers)}")
    return numbers
