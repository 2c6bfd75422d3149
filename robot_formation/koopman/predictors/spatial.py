"""Vectors (u, v, turn), their composition as motions in the plane, and models that forecast all three.

u [m] to the right, v [m] forward, turn [rad] anticlockwise; each in the frame at the motion's start.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import Diagnostics, Matrix, Model, Vector


def rotated(uv: Vector, turn_rad: float) -> Vector:
    """Return a vector (2,) that is told in a frame turned by `turn_rad`, as the frame before tells it."""
    if not turn_rad:
        return uv
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    u, v = uv.tolist()
    return np.array([cosine * u - sine * v, sine * u + cosine * v])


def after(first: Vector, second: Vector) -> Vector:
    """Compose two motions (3,): `first`, then `second` in the frame in which the first ends."""
    return np.append(rotated(second[:2], float(first[2])) + first[:2], second[2] + first[2])


def between(before: Vector, now: Vector) -> Vector:
    """Return the motion (3,) that leads from one pose to another, in the frame of the first."""
    return np.append(rotated(now[:2] - before[:2], -float(before[2])), now[2] - before[2])


def ways(steps: Matrix) -> Matrix:
    """Compose motions (n, 3), each in the frame in which the one before ends; return all the sums, (n, 3)."""
    found = np.empty_like(steps)
    found[:, 2] = np.cumsum(steps[:, 2])
    if steps[:, 2].any():
        headings = found[:, 2] - steps[:, 2]
        cosines, sines = np.cos(headings), np.sin(headings)
        u, v = steps[:, 0], steps[:, 1]
        found[:, 0] = np.cumsum(cosines * u - sines * v)
        found[:, 1] = np.cumsum(sines * u + cosines * v)
    else:
        found[:, :2] = np.cumsum(steps[:, :2], axis=0)
    return found


class Spatial:
    """A model of (u, v, turn): one of (u, v) together, and one of the turn by itself."""

    def __init__(self, uv: Model, turn: Model) -> None:
        self._uv, self._turn = uv, turn

    def __repr__(self) -> str:
        return f"Spatial({self._uv!r}, turn={self._turn!r})"

    def observe(self, x: Vector) -> None:
        """Update with the measured displacement (3,) of a timestep."""
        self._uv.observe(x[:2])
        self._turn.observe(x[2:])

    def advance(self) -> None:
        """Go on by a timestep that nobody measured."""
        self._uv.advance()
        self._turn.advance()

    def ahead(self, steps: int) -> Matrix:
        """Forecast the next displacements, (steps, 3), in an array of the caller's own."""
        return np.hstack([self._uv.ahead(steps), self._turn.ahead(steps)])

    def diagnostics(self) -> Diagnostics:
        """Show the model of (u, v)."""
        return self._uv.diagnostics()

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        return {"uv": self._uv.state(), "turn": self._turn.state()}

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned."""
        self._uv.restore(state["uv"])
        self._turn.restore(state["turn"])
