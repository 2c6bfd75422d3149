"""What falls on a robot's camera: direct projection of the scene, before the sensor sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.world.parameters import CameraParameters, WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.scene import FULL, RobotFaces, Scene

RenderedPicture = NDArray[np.uint8]
"""What a robot's camera gives: RGB (rows, columns, 3) of the size that the camera's parameters say."""
Light = NDArray[np.uint16]
"""Linear light (rows, columns, 3): reflectance under the room's light, 65535 is full."""

SUPERSAMPLING = 2
SHIFT = 6
"""Fractional bits of drawn coordinates."""


class Camera:
    """Pinhole camera on a robot: the light that its lens throws on the sensor; `Sensor` makes pictures of it.

    Image coordinates: integer (column, row) are pixel centres, origin top left. Light is computed linearly, averaged
    over 2 x 2 samples and blurred.
    """

    def __init__(self, surface: Surface, parameters: WorldParameters) -> None:
        self.parameters = parameters.camera
        self._scene = Scene(surface, parameters)
        p = parameters.camera
        pan, tilt = math.radians(p.pan_deg), math.radians(p.tilt_deg)
        forward = np.array([math.cos(pan) * math.cos(tilt), math.sin(pan) * math.cos(tilt), math.sin(tilt)])
        right = np.array([math.sin(pan), -math.cos(pan), 0.0])
        self._axes = np.stack([right, np.cross(forward, right), forward])  # rows: image right, image down, depth
        self._lens = np.array([p.x_m, p.y_m, p.z_m])
        self._canvas = np.empty((p.height_px * SUPERSAMPLING, p.width_px * SUPERSAMPLING, 3), np.uint16)
        self._blurred = np.empty((p.height_px, p.width_px, 3), np.float32)
        self._bounds = _view_bounds(p)
        self._unit_bounds = self._bounds / np.linalg.norm(self._bounds, axis=1, keepdims=True)

    def optical_frame(self, robot: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotation (3, 3) from the world to the optical frame (x right, y down, z ahead) and the lens's place (3,)."""
        rotation = robot.matrix()
        return self._axes @ rotation.T, np.asarray(robot.position) + rotation @ self._lens

    def project(self, robot: Pose, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Exact pinhole image (n, 2) in pixels (column, row) of world points (n, 3) before the lens."""
        rotation, lens = self.optical_frame(robot)
        local = (np.asarray(points) - lens) @ rotation.T
        p = self.parameters
        return np.asarray(local[:, :2] / local[:, 2:] * p.focal_length_px + np.array([p.centre_x_px, p.centre_y_px]))

    def may_see(self, robot: Pose, others: Sequence[Pose]) -> list[Pose]:
        """List those of other robots of which something may be in a robot's view; the picture is of no others."""
        rotation, lens = self.optical_frame(robot)
        radius = self._scene.robot_radius_m
        found = []
        for other in others:
            middle = rotation @ (other.matrix() @ self._scene.robot_middle + other.position - lens)
            if middle[2] > self.parameters.near_m - radius and (self._unit_bounds @ middle).min() > -radius:
                found.append(other)
        return found

    def light(self, robot: Pose, others: Sequence[Pose]) -> Light:
        """Light on the sensor, uint16 (rows, columns, 3) red, green, blue, of a robot that sees robots at `others`.

        Poses are base_link poses; no physics is involved. The lamp is white and has no strength here.
        """
        p = self.parameters
        rotation, lens = self.optical_frame(robot)
        canvas = self._canvas
        canvas[:] = np.asarray(self._scene.wall_light * FULL, np.uint16)
        self._draw_plate(lens, rotation)
        seen = self.may_see(robot, others)
        for other in sorted(seen, key=lambda pose: -float(np.sum((np.asarray(pose.position) - lens) ** 2))):
            self._draw_robot(self._scene.robot_faces(other, lens), lens, rotation)
        small: Light = np.asarray(
            cv2.resize(canvas, (p.width_px, p.height_px), interpolation=cv2.INTER_AREA), np.uint16
        )
        if p.blur_px > 0.0:
            # OpenCV blurs floats twice as fast as 16-bit integers.
            blurred = self._blurred
            np.copyto(blurred, small)
            cv2.GaussianBlur(blurred, (3, 3), p.blur_px, dst=blurred, borderType=cv2.BORDER_REPLICATE)
            small = np.rint(blurred, out=blurred).astype(np.uint16)
        return small

    def _draw_plate(self, lens: NDArray[np.float64], rotation: NDArray[np.float64]) -> None:
        """Draw the patches of the plate that are in view, far to near."""
        near = self.parameters.near_m
        local = (self._scene.plate_points - lens) @ rotation.T
        drawn = self._on_canvas(np.maximum(local, [-np.inf, -np.inf, near]))
        corners = self._scene.patch_corners
        depths = local[corners, 2]
        ahead = depths.min(axis=1) >= near
        outline = drawn[corners]
        # A patch with all corners behind one of the planes that bound the view can't be seen.
        hidden = (local @ self._bounds.T < 0.0)[corners].all(axis=1).any(axis=1)
        shown = np.flatnonzero((depths.max(axis=1) >= near) & ~hidden)
        for index in shown[np.argsort(-depths[shown].mean(axis=1), kind="stable")].tolist():
            colour = self._scene.patch_light[index]
            if ahead[index]:
                cv2.fillConvexPoly(self._canvas, outline[index], colour, lineType=cv2.LINE_8, shift=SHIFT)
            else:
                self._fill(local[corners[index]], colour)

    def _draw_robot(self, faces: RobotFaces, lens: NDArray[np.float64], rotation: NDArray[np.float64]) -> None:
        local = (faces.corners - lens) @ rotation.T
        ahead = len(local) > 0 and local[:, 2].min() >= self.parameters.near_m
        corners = self._on_canvas(local) if ahead else local
        first = 0
        for last, colour in zip(faces.ends, faces.colours, strict=True):
            if ahead:
                cv2.fillConvexPoly(self._canvas, corners[first:last], colour, lineType=cv2.LINE_8, shift=SHIFT)
            else:
                self._fill(local[first:last], colour)
            first = last

    def _fill(self, corners: NDArray[np.float64], colour: tuple[float, float, float]) -> None:
        """Draw a convex polygon (n, 3) of the optical frame in linear light."""
        near = self.parameters.near_m
        if corners[:, 2].min() < near:
            corners = clip_near(corners, near)
            if len(corners) < 3:
                return
        cv2.fillConvexPoly(self._canvas, self._on_canvas(corners), colour, lineType=cv2.LINE_8, shift=SHIFT)

    def _on_canvas(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Fixed-point canvas coordinates (n, 2) of points (n, 3) of the optical frame ahead of the lens."""
        p = self.parameters
        pixels = points[:, :2] * (p.focal_length_px / points[:, 2])[:, None]
        pixels += (p.centre_x_px, p.centre_y_px)
        # Sample centres lie a quarter pixel around pixel centres; far-off corners stay inside OpenCV's integers.
        fixed = np.clip((pixels * SUPERSAMPLING + 0.5) * (1 << SHIFT), -1e8, 1e8)
        return np.rint(fixed).astype(np.int32)


def _view_bounds(parameters: CameraParameters) -> NDArray[np.float64]:
    """Inward normals (4, 3) of the planes through the lens that bound the view: left, right, top, bottom.

    They leave a margin of two pixels, so that nothing at the picture's edge is taken for hidden.
    """
    p, margin = parameters, 2.5
    left, top = p.centre_x_px + margin, p.centre_y_px + margin
    right, bottom = p.width_px - 1 - p.centre_x_px + margin, p.height_px - 1 - p.centre_y_px + margin
    f = p.focal_length_px
    return np.array([[f, 0.0, left], [-f, 0.0, right], [0.0, f, top], [0.0, -f, bottom]])


def clip_near(corners: NDArray[np.float64], near: float) -> NDArray[np.float64]:
    """Cut a polygon (n, 3) of the optical frame at depth `near`; what remains lies ahead of it."""
    kept: list[NDArray[np.float64]] = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside, next_inside = a[2] >= near, b[2] >= near
        if inside:
            kept.append(a)
        if inside != next_inside:
            kept.append(a + (b - a) * ((near - a[2]) / (b[2] - a[2])))
    return np.array(kept).reshape(-1, 3)
