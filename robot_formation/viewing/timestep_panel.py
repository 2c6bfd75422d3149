"""Corrections and formation error of each timestep, as far as they have come."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from robot_formation.analysis.figures import timestep_axis
from robot_formation.analysis.style import BLACK, U_COLOUR, V_COLOUR
from robot_formation.viewing.recorded_scene import RecordedScene

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_CM = 100.0
_LEAST_CM = 1.0
_BARS: dict[str, Any] = {"width": 0.72, "edgecolor": "white", "linewidth": 0.5, "animated": True}


class TimestepPanel:
    """The panel; `artists` are what changes with time, in the order in which they are drawn."""

    def __init__(self, axes: Axes, scene: RecordedScene) -> None:
        self._scene = scene
        timestep_axis(axes, scene.timesteps, label="")
        axes.text(0.6, 0.98, "collection", transform=axes.get_xaxis_transform(), va="top", fontsize=8, color="0.35")
        axes.set(xlabel="timestep", ylabel="cm", ylim=(0.0, 1.2 * self._highest_cm()))
        axes.grid(axis="y")
        # A bar for those that were begun only: a bag may plan any number.
        numbers = range(1, min(scene.timesteps, scene.timesteps_with_moves) + 1)
        zeros = np.zeros(len(numbers))
        self._v = axes.bar(numbers, zeros, color=V_COLOUR, label="correction v", **_BARS)
        self._u = axes.bar(numbers, zeros, color=U_COLOUR, hatch="////", label="correction u", **_BARS)
        (self._errors,) = axes.plot(
            [], [], "o-", color=BLACK, markersize=4, linewidth=1.0, label="formation error", animated=True
        )
        self.artists: list[Artist] = [*self._v.patches, *self._u.patches, self._errors]

    def update(self, stamp_ns: int) -> None:
        """Show a time."""
        scene = self._scene
        for timestep in range(1, len(self._v.patches) + 1):
            done = scene.corrections(timestep, stamp_ns)
            self._v.patches[timestep - 1].set_height(done.v_m * _CM)
            self._u.patches[timestep - 1].set_y(done.v_m * _CM)
            self._u.patches[timestep - 1].set_height(done.u_m * _CM)
        finished = range(1, scene.finished(stamp_ns) + 1)
        known = [(t, error) for t in finished if (error := scene.error_m(t, stamp_ns)) is not None]
        self._errors.set_data([t for t, _ in known], [error * _CM for _, error in known])

    def _highest_cm(self) -> float:
        scene = self._scene
        sums = [sum(scene.corrections(t, scene.end_ns)) for t in range(1, scene.timesteps_with_moves + 1)]
        errors = [scene.error_m(t, scene.end_ns) or 0.0 for t in range(1, scene.finished(scene.end_ns) + 1)]
        return max(_LEAST_CM, max([*sums, *errors], default=0.0) * _CM)
