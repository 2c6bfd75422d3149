"""Which robots a camera may see: those in its view that the nearest one does not hide. Only these need be drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_formation.world.parameters import CameraParameters, WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.scene import Scene, board_y_m

Array = NDArray[np.float64]

_MARGIN_PX = 2.5
"""Drawn outlines are half a pixel wide, and the blur reaches one pixel farther."""
_MIDDLE, _PARTS, _SCREENS = 0, slice(1, 17), slice(17, 25)
"""Places of a robot's points: corners of two boxes around it and of two rectangles inside it."""


class Occlusion:
    """Tells from poses which robots can't be in a picture. In doubt a robot is taken for seen.

    A robot with a board hides what lies behind its *screens*. They are two rectangles: its board with the part of the
    body below it, and the body's right side, which followers look at. Every line of sight through a screen meets a
    face that is drawn. Near robots are drawn over far ones, so a far robot leaves nothing in the picture if its body
    and what stands on it each lie in the image of one of the nearest robot's screens. Screens of other robots are not
    looked at: in the picture the nearest one's are the largest.
    """

    def __init__(self, scene: Scene, parameters: WorldParameters) -> None:
        camera = parameters.camera
        self._near = camera.near_m
        self._radius = scene.robot_radius_m
        bounds = view_bounds(camera)
        self._bounds = (bounds / np.linalg.norm(bounds, axis=1, keepdims=True)).T
        self._margin = _MARGIN_PX / camera.focal_length_px
        screens = _screens(parameters)
        self._has_screens = len(screens) > 0
        self._points = np.concatenate([scene.robot_middle[None], *scene.robot_boxes, *screens])
        self._body_bottom = parameters.chassis.body_bottom_m

    def seen(self, robots: Sequence[Pose], rotation: Array, lens: Array) -> list[Pose]:
        """List those robots of which something may be in a camera's picture, far to near.

        Args:
            robots: base_link poses.
            rotation: (3, 3) from the world to the camera's optical frame (x right, y down, z ahead).
            lens: where the lens is in the world, (3,), metres.
        """
        if not robots:
            return []
        turns = np.array([robot.matrix() for robot in robots])
        offsets = np.array([robot.position for robot in robots]) - lens
        local = (self._points @ turns.transpose(0, 2, 1) + offsets[:, None]) @ rotation.T
        middles = local[:, _MIDDLE]
        ahead = middles[:, 2] > self._near - self._radius
        in_view = ahead & ((middles @ self._bounds).min(axis=1) > -self._radius)
        far_to_near = np.argsort(-(offsets * offsets).sum(axis=1), kind="stable")
        order = far_to_near[in_view[far_to_near]]
        if self._has_screens and len(order) > 1:
            order = self._not_hidden(order, local, -offsets[order[-1]] @ turns[order[-1]])
        return [robots[index] for index in order.tolist()]

    def _not_hidden(self, order: NDArray[np.intp], points: Array, eye: Array) -> NDArray[np.intp]:
        """Leave out what the last robot hides, whose base_link frame has the lens at `eye` (3,).

        `points` (robots, 25, 3) are the robots' points in the optical frame.
        """
        nearest = points[order[-1]]
        # What is before the near plane is not drawn, and bodies have no lower face.
        if nearest[_PARTS, 2].min() < self._near or eye[2] <= self._body_bottom:
            return order
        parts = points[order, _PARTS]
        inside = (parts @ self._sides(nearest[_SCREENS]) > 0.0).reshape(len(order), 2, 8, 2, 4)
        behind: NDArray[np.bool_] = np.all(inside, axis=(2, 4))
        hidden: NDArray[np.bool_] = np.all(np.any(behind, axis=2), axis=1)
        hidden[-1] = False
        return np.asarray(order[~hidden])

    def _sides(self, screens: Array) -> Array:
        """Inward normals, as columns (3, 8), of planes through the lens that bound two screens (8, 3) with a margin."""
        x, y, z = screens.T
        x2, y2, z2 = screens[[1, 2, 3, 0, 5, 6, 7, 4]].T
        normals = np.array([y * z2 - z * y2, z * x2 - x * z2, x * y2 - y * x2])
        # The corners' order is the other one when a screen is seen from behind.
        inward = np.sign((normals[:, [0, 4]] * screens[[2, 6]].T).sum(axis=0))
        normals *= np.repeat(inward, 4) / np.sqrt((normals * normals).sum(axis=0))
        normals[2] -= self._margin
        return np.asarray(normals)


def view_bounds(camera: CameraParameters) -> Array:
    """Inward normals (4, 3) of the planes through the lens that bound the view: left, right, top, bottom.

    They leave a margin, so that nothing at the picture's edge is taken for hidden.
    """
    left, top = camera.centre_x_px + _MARGIN_PX, camera.centre_y_px + _MARGIN_PX
    right = camera.width_px - 1 - camera.centre_x_px + _MARGIN_PX
    bottom = camera.height_px - 1 - camera.centre_y_px + _MARGIN_PX
    f = camera.focal_length_px
    return np.array([[f, 0.0, left], [-f, 0.0, right], [0.0, f, top], [0.0, -f, bottom]])


def _screens(parameters: WorldParameters) -> list[Array]:
    """Corners (4, 3) of a robot's screens in its base_link frame, in order around them; none without a board."""
    marker, chassis = parameters.marker, parameters.chassis
    y = board_y_m(marker)
    if marker.backdrop_m <= 0.0 or y >= 0.5 * chassis.width_m:
        return []
    x, bottom = 0.5 * chassis.length_m, chassis.body_bottom_m
    screens = (min(x, 0.5 * marker.backdrop_m), y, marker.top_m), (x, -0.5 * chassis.width_m, chassis.body_top_m)
    return [np.array([[-x, y, bottom], [x, y, bottom], [x, y, top], [-x, y, top]]) for x, y, top in screens]
