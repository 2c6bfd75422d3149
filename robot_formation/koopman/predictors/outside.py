"""Predictors from outside the package: a class with `observe` and `forecast`, and what it leaves out."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from robot_formation import plugins
from robot_formation.json_values import Json, JsonObject
from robot_formation.koopman.predictors.models import Diagnostics, Matrix, Vector

KIND = "predictor"
_NEEDED = ("observe", "forecast")


class OutsideModel:
    """A model of (u, v, turn) made of a class from outside, which needs two methods.

    `observe(displacement)` is shown each measured displacement, an array (3,) of u [m], v [m] and turn [rad].
    `forecast` is called with the number of timesteps ahead, if it takes an argument; it returns the next displacement
    as an array of two (u, v) or three numbers, or one row for each timestep ahead. What it leaves out has defaults: one
    displacement stands for all timesteps to come, and a turn that isn't forecast is zero.

    Optional: `advance()`, for a timestep that nobody measured (default: it observes its own forecast); `state()` and
    `restore(state)`, JSON (default: all displacements are kept, and shown again); `diagnostics()`, a `Diagnostics`.
    """

    def __init__(self, name: str, kind: type) -> None:
        """Make one of a class, without arguments; `name` is for messages.

        Raises:
            PluginError: if it can't be made, or lacks a method.
        """
        self._name = name
        missing = [method for method in _NEEDED if not callable(getattr(kind, method, None))]
        if missing:
            raise plugins.PluginError(f"{KIND} '{name}': it has no method '{missing[0]}'; see docs/how-to/extend.md")
        self._made = self._call("making one without arguments", kind)
        self._takes_steps = _takes_an_argument(self._made.forecast)
        self._shown: list[list[float]] | None = None if hasattr(self._made, "state") else []

    def __repr__(self) -> str:
        return f"OutsideModel('{self._name}')"

    def observe(self, x: Vector) -> None:
        """Update with the measured displacement (3,) of a timestep."""
        self._call("observe", self._made.observe, x.copy())
        if self._shown is not None:
            self._shown.append(x.tolist())

    def advance(self) -> None:
        """Go on by a timestep that nobody measured."""
        if hasattr(self._made, "advance"):
            self._call("advance", self._made.advance)
        else:
            self.observe(self.ahead(1)[0])

    def ahead(self, steps: int) -> Matrix:
        """Forecast the next displacements, (steps, 3), in an array of the caller's own.

        Raises:
            PluginError: if what the class returns isn't such a forecast.
        """
        arguments = (steps,) if self._takes_steps else ()
        answer = self._call("forecast", self._made.forecast, *arguments)
        try:
            rows = np.atleast_2d(np.array(answer, dtype=float))
        except (TypeError, ValueError):
            rows = np.zeros((0, 0))
        count, columns = rows.shape if rows.ndim == 2 else (0, 0)
        if columns not in (2, 3) or not count >= 1 or not np.isfinite(rows).all():
            raise plugins.PluginError(
                f"{KIND} '{self._name}': a forecast is two or three finite numbers (u, v, turn), "
                f"or such a row for each timestep, not {_shown(answer)}"
            )
        found = np.zeros((steps, 3))
        found[:count, :columns] = rows[:steps]
        found[count:, :columns] = rows[-1]
        return found

    def diagnostics(self) -> Diagnostics:
        """Show what the class shows of itself, if it does."""
        shown = self._call("diagnostics", self._made.diagnostics) if hasattr(self._made, "diagnostics") else None
        return shown if isinstance(shown, Diagnostics) else Diagnostics()

    def state(self) -> JsonObject:
        """Return all that it has learned."""
        if self._shown is not None:
            return {"shown": self._shown}
        return {"own": self._call("state", self._made.state)}

    def restore(self, state: Mapping[str, Json]) -> None:
        """Restore what `state` returned.

        Raises:
            ValueError: if it holds no displacements.
        """
        if self._shown is None:
            self._call("restore", self._made.restore, state["own"])
            return
        shown = np.array(state["shown"], dtype=float).reshape(-1, 3)
        if not np.isfinite(shown).all():
            raise ValueError("finite displacements are expected")
        for x in shown:
            self.observe(x)

    def _call(self, what: str, function: Callable[..., Any], *arguments: object) -> Any:
        with plugins.guarded(KIND, self._name, what):
            return function(*arguments)


def _takes_an_argument(function: Callable[..., Any]) -> bool:
    """Whether a function can be called with one positional argument."""
    try:
        inspect.signature(function).bind(1)
    except (TypeError, ValueError):
        return False
    return True


def _shown(answer: object) -> str:
    text = repr(answer).replace("\n", " ")
    return text if len(text) <= 60 else text[:57] + "..."
