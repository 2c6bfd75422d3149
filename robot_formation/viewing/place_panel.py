"""How far a follower is from its place: its reference point in the neighbour's frame, with the forecast."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.style import robot_colour
from robot_formation.geometry.se2 import Motion
from robot_formation.viewing.plan_panel import FORECAST_COLOUR, PLACE_COLOUR, ellipse_uv_m
from robot_formation.viewing.recorded_scene import RecordedScene

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_CM = 100.0
_TAIL_NS = 3 * 10**9
"""How far back the follower's way about its place is drawn."""
_TAIL_POINTS = 60
_LEAST_REACH_CM = 3.0


class PlacePanel:
    """The panel; `artists` are what changes with time, in the order in which they are drawn."""

    def __init__(self, axes: Axes, scene: RecordedScene) -> None:
        from matplotlib.patches import Polygon

        self._scene = scene
        reach = _reach_cm(scene)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        axes.set(xlabel="u, to the right (cm)", ylabel="v, ahead (cm)")
        axes.grid(visible=True)
        axes.axhline(0.0, color=PLACE_COLOUR, linewidth=0.8, linestyle=(0, (4, 2)))
        axes.axvline(0.0, color=PLACE_COLOUR, linewidth=0.8, linestyle=(0, (4, 2)))
        colour = robot_colour(scene.follower)
        self._forecast = Polygon(
            np.zeros((1, 2)), facecolor=FORECAST_COLOUR, edgecolor=FORECAST_COLOUR, alpha=0.5, animated=True
        )
        axes.add_patch(self._forecast)
        (self._tail,) = axes.plot([], [], color=colour, linewidth=1.2, alpha=0.6, animated=True)
        (self._point,) = axes.plot([], [], "o", color=colour, markeredgecolor="black", markersize=7, animated=True)
        self.artists: list[Artist] = [self._forecast, self._tail, self._point]

    def update(self, stamp_ns: int) -> None:
        """Show a time."""
        scene = self._scene
        tail_ns = np.linspace(max(scene.start_ns, stamp_ns - _TAIL_NS), stamp_ns, _TAIL_POINTS)
        points = _off_place_cm(scene, tail_ns)
        self._tail.set_data(*points.T)
        self._point.set_data(*points[-1:].T)
        forecast = scene.forecast(stamp_ns)
        self._forecast.set_visible(forecast is not None)
        if forecast is not None:
            outline = ellipse_uv_m(forecast)
            ahead = Motion(forecast.place.x_m, forecast.place.y_m, forecast.heading_rad)
            corners = [ahead.then(Motion.from_uv(u_m, v_m)) for u_m, v_m in outline.tolist()]
            self._forecast.set_xy(np.array([scene.off_place_uv_m(corner, stamp_ns) for corner in corners]) * _CM)


def _off_place_cm(scene: RecordedScene, stamps_ns: Iterable[float]) -> NDArray[np.float64]:
    """Return where the follower was about its place at several times, (n, 2), u and v in centimetres."""
    found = [scene.off_place_uv_m(scene.at(scene.follower, int(stamp)), int(stamp)) for stamp in stamps_ns]
    return np.array(found) * _CM


def _reach_cm(scene: RecordedScene) -> float:
    """Return how far the panel reaches: the follower is in it all the time, or nearly so where it gets lost."""
    own, others = (scene.poses(robot).stamps_ns.tolist() for robot in (scene.follower, scene.neighbour))
    farthest = np.quantile(np.abs(_off_place_cm(scene, [*own, *others])).max(axis=1), 0.99)
    return max(_LEAST_REACH_CM, math.ceil(1.15 * float(farthest)))
