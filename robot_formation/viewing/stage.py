"""Robots, ground and what goes with them as a scene of viser."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_formation import names
from robot_formation.analysis.run_record import Ground
from robot_formation.analysis.style import robot_colour
from robot_formation.geometry.orientation import Quaternion, Vector
from robot_formation.geometry.se2 import Motion
from robot_formation.viewing.ground_lines import GroundHeight, contour_lines
from robot_formation.viewing.lens import Lens
from robot_formation.viewing.moment import Moment, Picture, RobotNow, ShownForecast
from robot_formation.viewing.robot_shape import Link, Part, Rgb

_GROUND_RGB: Rgb = (206, 210, 200)
_LOW_RGB, _HIGH_RGB = np.array((70, 90, 120)), np.array((190, 120, 60))
_LIFT_M = 0.004
"""Lines lie so far above the ground, so that it doesn't hide them."""
_LINE_M = 0.004
_CONE_M = 0.13
_LABEL_M = 0.29
_PICTURE_QUALITY = 70
_BODY_OPACITY = 0.6
"""The body is seen through, since it hides the wheels."""
_SPOKE_RGB: Rgb = (190, 190, 190)
_FORECAST_M = 0.235
"""Forecasts are drawn so high above the ground, over the robots: what is below them can't be seen."""
_CROSS_M = 0.009
_BESIDE_M = 0.015


def robot_rgb(robot: str) -> Rgb:
    """Return the colour that a robot's path, place and name have."""
    red, green, blue = bytes.fromhex(robot_colour(robot)[1:])
    return red, green, blue


class Stage:
    """Draws in a viser server: what stands still once, what moves with each `show`, and only what has changed.

    Args:
        server: viser's ViserServer.
    """

    def __init__(self, server: Any) -> None:
        self._server, self._scene = server, server.scene
        self._height = GroundHeight()
        self._frames: dict[str, Any] = {}
        self._joints: dict[str, list[Link]] = {}
        self._cameras: dict[str, Any] = {}
        self._places: dict[str, Any] = {}
        self._outlines: dict[str, NDArray[np.float64]] = {}
        self._forecasts: dict[str, tuple[ShownForecast | None, Any]] = {}
        self._shown: dict[str, tuple[float, ...]] = {}
        self._scene.world_axes.visible = False
        # Shadows take most of the time of a browser that draws without a graphics card.
        self._scene.configure_default_lights(cast_shadow=False)

    def ground(self, ground: Ground) -> None:
        """Draw the ground with its contour lines, and look at it as a whole."""
        self._height = GroundHeight(ground)
        self._scene.add_mesh_simple(
            "/ground/mesh", ground.vertices_m, ground.triangles, color=_GROUND_RGB, side="double", cast_shadow=False
        )
        contours = contour_lines(ground)
        for number, (_, segments) in enumerate(contours):
            share = number / max(1, len(contours) - 1)
            rgb = np.rint(_LOW_RGB + share * (_HIGH_RGB - _LOW_RGB)).astype(np.uint8)
            lifted = segments + np.array((0.0, 0.0, _LIFT_M))
            self._scene.add_line_segments(f"/ground/contour_{number}", lifted, rgb, thickness=0.5 * _LINE_M)
        self.look_at(ground.vertices_m)

    def look_at(self, points_m: NDArray[np.float64]) -> None:
        """Let browsers that open the page look at points (n, 3) from the right and behind, from above."""
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        middle, size = 0.5 * (low + high), max(0.5, float(np.linalg.norm((high - low)[:2])))
        camera = self._server.initial_camera
        camera.look_at = tuple(middle.tolist())
        camera.position = tuple((middle + size * np.array((0.55, -0.75, 0.7))).tolist())
        camera.fov = math.radians(45.0)
        camera.near, camera.far = 0.05, 100.0

    def robot(self, robot: str, links: Sequence[Link]) -> None:
        """Draw a robot, or anew if its description has changed."""
        frame = self._scene.add_frame(f"/robots/{robot}", show_axes=False)
        self._frames[robot] = frame
        self._joints[robot] = [link for link in links if link.axis is not None]
        self._outlines[robot] = _outline(links)
        for link in links:
            path = f"/robots/{robot}/{link.name}"
            self._frames[path] = self._scene.add_frame(
                path, show_axes=False, position=link.place_m, wxyz=_wxyz(link.turn)
            )
            for number, part in enumerate(link.parts):
                body = link.name == names.BASE_FRAME and part is _largest(links)
                self._part(f"{path}/{number}", part, _BODY_OPACITY if body else None)
                if link.axis is not None and not part.is_box:
                    self._spokes(f"{path}/spokes_{number}", part)
        label = robot.replace("_", " ")
        self._scene.add_label(f"/robots/{robot}/name", label, position=(0.0, 0.0, _LABEL_M), font_screen_scale=0.8)
        self._shown = {key: value for key, value in self._shown.items() if not key.startswith(f"/robots/{robot}/")}
        self._shown.pop(f"/robots/{robot}", None)

    def camera(self, robot: str, lens: Lens) -> None:
        """Draw a robot's camera as a cone, where it has one."""
        optical = f"/robots/{robot}/{names.OPTICAL_FRAME}"
        if optical in self._frames:
            self._cameras[robot] = self._scene.add_camera_frustum(
                f"{optical}/cone",
                lens.fov_rad,
                lens.aspect,
                scale=_CONE_M,
                thickness=0.5 * _LINE_M,
                color=robot_rgb(robot),
                jpeg_quality=_PICTURE_QUALITY,
                cast_shadow=False,
            )

    def path(self, robot: str, points_m: NDArray[np.float64]) -> None:
        """Draw the way (n, 3) that a robot's base_link takes."""
        if len(points_m) > 1:
            lifted = points_m + np.array((0.0, 0.0, _LIFT_M))
            self._segments(f"/paths/{robot}", np.stack([lifted[:-1], lifted[1:]], axis=1), robot_rgb(robot))

    def picture(self, robot: str, picture: Picture) -> None:
        """Show what a robot's camera saw at the end of its cone."""
        if robot in self._cameras:
            self._cameras[robot].image = picture

    def show(self, moment: Moment) -> None:
        """Move everything to where it is at an instant."""
        with self._server.atomic():
            for robot, pose in moment.robots.items():
                self._move(robot, pose)
            for robot, now in moment.followers.items():
                self._place(robot, now.place)
                self._forecast(robot, now.forecast)

    def _move(self, robot: str, pose: RobotNow) -> None:
        if robot not in self._frames:
            return
        self._put(f"/robots/{robot}", self._frames[robot], pose.position_m, pose.orientation)
        for link in self._joints[robot]:
            path = f"/robots/{robot}/{link.name}"
            turn = link.turned(pose.joints_rad.get(link.name, 0.0))
            self._put(path, self._frames[path], link.place_m, turn)

    def _put(self, key: str, handle: Any, place_m: Vector, turn: Quaternion) -> None:
        """Set what differs from what browsers have, to a tenth of a millimetre and of a milliradian."""
        pose = (*(round(value, 4) for value in place_m), *(round(value, 4) for value in turn))
        before = self._shown.get(key, ())
        if pose[:3] != before[:3]:
            handle.position = pose[:3]
        if pose[3:] != before[3:]:
            handle.wxyz = _wxyz((pose[3], pose[4], pose[5], pose[6]))
        self._shown[key] = pose

    def _place(self, robot: str, place: Motion | None) -> None:
        key = f"/places/{robot}"
        if place is None or robot not in self._outlines:
            return
        if key not in self._places:
            self._places[key] = self._segments(key, self._outlines[robot], robot_rgb(robot))
        (height,) = self._height.of(np.array([[place.x_m, place.y_m]])).tolist()
        self._put(key, self._places[key], (place.x_m, place.y_m, height + 2 * _LIFT_M), _about_z(place.yaw_rad))

    def _forecast(self, robot: str, forecast: ShownForecast | None) -> None:
        shown, handle = self._forecasts.get(robot, (None, None))
        if forecast is None or forecast == shown:
            if handle is not None and forecast is None and shown is not None:
                handle.visible = False
                self._forecasts[robot] = (None, handle)
            return
        segments = self._forecast_lines(forecast)
        if handle is None:
            handle = self._segments(f"/forecasts/{robot}", segments, (0, 0, 0))
        else:
            handle.points = segments.astype(np.float32)
            handle.visible = True
        self._forecasts[robot] = (forecast, handle)

    def _forecast_lines(self, forecast: ShownForecast) -> NDArray[np.float64]:
        """Return the displacement, a cross where it ends, and the ellipse around it, (n, 2, 3)."""
        start, end = forecast.start, forecast.end
        arm = _CROSS_M
        places = [[(start.x_m, start.y_m), (end.x_m, end.y_m)]]
        places += [[(end.x_m - x, end.y_m - y), (end.x_m + x, end.y_m + y)] for x, y in ((arm, arm), (arm, -arm))]
        ellipse = forecast.ellipse()
        flat = np.concatenate([np.array(places), np.stack([ellipse[:-1], ellipse[1:]], axis=1)])
        return self._height.on_ground(flat.reshape(-1, 2), _FORECAST_M).reshape(-1, 2, 3)

    def _segments(self, path: str, segments: NDArray[np.float64], rgb: Rgb) -> Any:
        return self._scene.add_line_segments(path, segments.astype(np.float32), rgb, thickness=_LINE_M)

    def _part(self, path: str, part: Part, opacity: float | None) -> None:
        where: Mapping[str, Any] = {
            "position": part.place_m,
            "wxyz": _wxyz(part.turn),
            "color": part.rgb,
            "opacity": opacity,
        }
        if part.is_box:
            self._scene.add_box(path, dimensions=part.size_m, **where)
        else:
            radius, length = part.size_m
            self._scene.add_cylinder(path, radius, length, radial_segments=24, **where)

    def _spokes(self, path: str, part: Part) -> None:
        """Draw a bar across a wheel, a little longer than the wheel is wide: a plain cylinder doesn't show its turn."""
        radius, length = part.size_m
        size = (1.7 * radius, 0.3 * radius, 1.04 * length)
        self._scene.add_box(
            path, dimensions=size, position=part.place_m, wxyz=_wxyz(part.turn), color=_SPOKE_RGB, cast_shadow=False
        )


def _largest(links: Sequence[Link]) -> Part | None:
    """Return the box that covers most ground."""
    boxes = [part for link in links for part in link.parts if part.is_box]
    return max(boxes, key=lambda box: box.size_m[0] * box.size_m[1], default=None)


def _wxyz(orientation: Quaternion) -> Quaternion:
    """Order the components of an orientation as viser does."""
    x, y, z, w = orientation
    return (w, x, y, z)


def _about_z(angle_rad: float) -> Quaternion:
    return (0.0, 0.0, math.sin(0.5 * angle_rad), math.cos(0.5 * angle_rad))


def _outline(links: Sequence[Link]) -> NDArray[np.float64]:
    """Return a place's sign: a rectangle around the robot's body, and a bar that tells the heading (x): (5, 2, 3) m."""
    largest = _largest(links)
    length, width = (0.2, 0.2) if largest is None else largest.size_m[:2]
    x, y = 0.5 * length + _BESIDE_M, 0.5 * width + _BESIDE_M
    corners = np.array([(x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0)])
    heading = np.array([[(x, 0.0, 0.0), (x + 2.0 * _BESIDE_M, 0.0, 0.0)]])
    return np.concatenate([np.stack([corners[:-1], corners[1:]], axis=1), heading])
