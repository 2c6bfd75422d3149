"""A run from above: robots over the ground's contour lines, their ways, the place in formation, the forecast."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.quantiles import ELLIPSE_90
from robot_formation.analysis.run_record import Ground
from robot_formation.analysis.style import FACE_COLOURS, robot_colour
from robot_formation.geometry.se2 import Motion
from robot_formation.viewing.recorded_scene import PlaceForecast, RecordedScene

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

Array = NDArray[np.float64]

PLACE_COLOUR, FORECAST_COLOUR, VIEW_COLOUR = "0.25", "#D55E00", "#F0E442"
_CM = 100.0
_MARGIN_M = 0.26
_FLAT_M = 1e-6
_LABEL_CM = 9.0
"""Room that the label of a contour line needs."""
_VIEW_M = 0.45
"""Length to which the camera's field of view is drawn."""
_FACE_COLOURS = tuple(FACE_COLOURS[face] for face in ("right", "front", "rear"))
_ELLIPSE = np.linspace(0.0, 2.0 * np.pi, 49)


def ellipse_uv_m(forecast: PlaceForecast) -> Array:
    """Return the outline (n, 2) of a forecast's 90 % ellipse about its middle: u and v in its heading, metres."""
    values, vectors = np.linalg.eigh(forecast.covariance_uv)
    axes = vectors * np.sqrt(ELLIPSE_90 * np.maximum(values, 0.0))
    return np.asarray(np.column_stack([np.cos(_ELLIPSE), np.sin(_ELLIPSE)]) @ axes.T)


class PlanPanel:
    """The panel; `artists` are what changes with time, in the order in which they are drawn."""

    def __init__(self, axes: Axes, scene: RecordedScene) -> None:
        self._axes, self._scene, self._world = axes, scene, scene.world
        ways = np.concatenate([scene.poses(robot).positions_m[:, :2] for robot in scene.robots])
        middle = 0.5 * (ways.min(axis=0) + ways.max(axis=0)) * _CM
        half = (0.5 * float(np.ptp(ways, axis=0).max()) + _MARGIN_M) * _CM
        axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
        axes.set(xlabel="x (cm)", ylabel="y (cm)")
        axes.spines[["top", "right"]].set_visible(True)
        if scene.record.ground is not None:
            _draw_ground(axes, scene.record.ground)
        self.artists: list[Artist] = []
        self._view = self._polygon(facecolor=VIEW_COLOUR, alpha=0.35, edgecolor="none")
        self._place = self._polygon(fill=False, edgecolor=PLACE_COLOUR, linewidth=1.1, linestyle=(0, (4, 2)))
        self._ways = {robot: self._way(robot_colour(robot)) for robot in scene.robots}
        body = {"edgecolor": "black", "linewidth": 0.8, "alpha": 0.55}
        self._bodies = {robot: self._polygon(facecolor=robot_colour(robot), **body) for robot in scene.robots}
        self._faces = {robot: [self._face(colour) for colour in _FACE_COLOURS] for robot in scene.robots}
        self._forecast = self._polygon(facecolor=FORECAST_COLOUR, edgecolor=FORECAST_COLOUR, linewidth=1.2, alpha=0.75)

    def _way(self, colour: str) -> Line2D:
        (line,) = self._axes.plot([], [], color=colour, linewidth=1.8, animated=True)
        self.artists.append(line)
        return line

    def _face(self, colour: str) -> Polygon:
        return self._polygon(fill=False, closed=False, edgecolor=colour, linewidth=2.6, capstyle="butt")

    def _polygon(self, **style: Any) -> Polygon:
        from matplotlib.patches import Polygon

        patch = Polygon(np.zeros((1, 2)), animated=True, **style)
        self._axes.add_patch(patch)
        self.artists.append(patch)
        return patch

    def update(self, stamp_ns: int) -> None:
        """Show a time."""
        scene, chassis = self._scene, self._world.chassis
        body = _rectangle(chassis.length_m, chassis.width_m)
        for robot in scene.robots:
            pose = scene.at(robot, stamp_ns)
            self._ways[robot].set_data(*(scene.way(robot, stamp_ns).T * _CM))
            self._bodies[robot].set_xy(_placed(pose, body))
            for patch, face in zip(self._faces[robot], self._marker(), strict=True):
                patch.set_xy(_placed(pose, face))
        self._place.set_xy(_placed(scene.place(stamp_ns), body))
        self._view.set_xy(_placed(scene.at(scene.follower, stamp_ns), self._field_of_view()))
        forecast = scene.forecast(stamp_ns)
        self._forecast.set_visible(forecast is not None)
        if forecast is not None:
            u_m, v_m = ellipse_uv_m(forecast).T
            middle = Motion(forecast.place.x_m, forecast.place.y_m, forecast.heading_rad)
            self._forecast.set_xy(_placed(middle, np.column_stack([v_m, -u_m])))

    def _marker(self) -> tuple[Array, Array, Array]:
        """Target, Front and Rear face of the marker from above: lines in base_link, metres."""
        half = 0.5 * self._world.marker.edge_m
        right_front, right_rear, left_front, left_rear = (half, -half), (-half, -half), (half, half), (-half, half)
        return (
            np.array([right_front, right_rear]),
            np.array([right_front, left_front]),
            np.array([right_rear, left_rear]),
        )

    def _field_of_view(self) -> Array:
        """What the camera sees, from above: a sector in base_link, metres."""
        camera = self._world.camera
        left = math.atan2(camera.centre_x_px, camera.focal_length_px)
        right = math.atan2(camera.width_px - 1 - camera.centre_x_px, camera.focal_length_px)
        angles = math.radians(camera.pan_deg) + np.linspace(-right, left, 13)
        lens = np.array([camera.x_m, camera.y_m])
        return np.vstack([lens, lens + _VIEW_M * np.column_stack([np.cos(angles), np.sin(angles)])])


def _draw_ground(axes: Axes, ground: Ground) -> None:
    from matplotlib.patches import Rectangle
    from matplotlib.tri import Triangulation

    x, y, z = ground.vertices_m.T
    edges: dict[str, Any] = {"fill": False, "edgecolor": "0.25", "linewidth": 1.0}
    axes.add_patch(Rectangle((x.min() * _CM, y.min() * _CM), np.ptp(x) * _CM, np.ptp(y) * _CM, **edges))
    if np.ptp(z) < _FLAT_M:
        return
    mesh = Triangulation(x * _CM, y * _CM, ground.triangles)
    lines = axes.tricontour(mesh, z * 1e3, levels=9, colors="0.72", linewidths=0.8)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    for label in axes.clabel(lines, fmt="%g mm", fontsize=7):
        x_cm, y_cm = label.get_position()
        label.set_visible(left + _LABEL_CM < x_cm < right - _LABEL_CM and low + _LABEL_CM < y_cm < high - _LABEL_CM)


def _rectangle(length_m: float, width_m: float) -> Array:
    return np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (0.5 * length_m, 0.5 * width_m)


def _placed(pose: Motion, points_m: Array) -> Array:
    """Return points (n, 2) of a frame, metres, in world x and y, centimetres."""
    cosine, sine = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.asarray((points_m @ np.array([(cosine, sine), (-sine, cosine)]) + (pose.x_m, pose.y_m)) * _CM)
