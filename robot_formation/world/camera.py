"""What falls on a robot's camera: direct projection of the scene, before the sensor sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.world.occlusion import Occlusion, view_bounds
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.scene import FULL, Colour, RobotFaces, Scene

RenderedPicture = NDArray[np.uint8]
"""What a robot's camera gives: RGB (rows, columns, 3) of the size that the camera's parameters say."""
Light = NDArray[np.uint16]
"""Linear light (rows, columns, 3): reflectance under the room's light, 65535 is full."""
_Face = tuple[NDArray[np.int32], Colour]
"""Fixed-point canvas coordinates of a convex face's corners (n, 2), and its light."""

SUPERSAMPLING = 2
SHIFT = 6
"""Fractional bits of drawn coordinates."""
_MARGIN_ROWS = 3
"""Rows of a picture above a face's topmost corner: its outline and the blur stay below the first of them."""


class Camera:
    """Pinhole camera on a robot: the light that its lens throws on the sensor; `Sensor` makes pictures of it.

    Image coordinates: integer (column, row) are pixel centres, origin top left. Light is computed linearly, averaged
    over 2 x 2 samples and blurred. Rows above all faces show the wall and are filled in at the end.
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
        self._centre = np.array([p.centre_x_px, p.centre_y_px])
        self._wall = np.asarray(self._scene.wall_light * FULL, np.uint16)
        self._canvas = np.empty((p.height_px * SUPERSAMPLING, p.width_px * SUPERSAMPLING, 3), np.uint16)
        self._sharp = np.empty((p.height_px, p.width_px, 3), np.uint16)
        self._blurred = np.empty((p.height_px, p.width_px, 3), np.float32)
        self._bounds = view_bounds(p)
        self._occlusion = Occlusion(self._scene, parameters)

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
        """List those of other robots of which something may be in a picture, far to near; it is of no others."""
        return self._occlusion.seen(others, *self.optical_frame(robot))

    def light(self, robot: Pose, others: Sequence[Pose]) -> Light:
        """Light on the sensor, uint16 (rows, columns, 3) red, green, blue, of a robot among robots at `others`.

        Poses are base_link poses; no physics is involved. The lamp is white and has no strength here.
        """
        return self.light_of(robot, self.may_see(robot, others))

    def light_of(self, robot: Pose, seen: Sequence[Pose]) -> Light:
        """Light on the sensor of a robot that sees the robots that `may_see` has listed, far to near."""
        p = self.parameters
        rotation, lens = self.optical_frame(robot)
        faces = self._plate(rotation, lens)
        for other in seen:
            faces += self._robot(self._scene.robot_faces(other, lens), rotation, lens)
        first = self._first_row(faces)
        canvas = self._canvas[SUPERSAMPLING * first :]
        canvas[:] = self._wall
        for outline, colour in faces:
            # On the whole canvas: OpenCV's lines depend on where they are clipped.
            cv2.fillConvexPoly(self._canvas, outline, colour, cv2.LINE_8, SHIFT)
        light: Light = np.empty((p.height_px, p.width_px, 3), np.uint16)
        self._sample(canvas, light[first:])
        light[:first] = light[first]
        return light

    def _plate(self, rotation: NDArray[np.float64], lens: NDArray[np.float64]) -> list[_Face]:
        """List the patches of the plate that are in view, far to near."""
        near, scene = self.parameters.near_m, self._scene
        local = (scene.plate_points - lens) @ rotation.T
        depths = np.ascontiguousarray(local[:, 2])
        # A patch with all corners behind one of the planes that bound the view can't be seen. A point's answers for the
        # four planes are four bytes, looked at as one number.
        behind = (local @ self._bounds.T < 0.0).view(np.uint32)
        ahead = scene.over_patches(np.maximum, depths) >= near
        shown = np.flatnonzero(ahead & (scene.over_patches(np.bitwise_and, behind) == 0))
        middles = np.add.reduce(depths[scene.patch_corners[shown]], axis=1)
        shown = shown[np.argsort(-middles, kind="stable")]
        corners = scene.patch_corners[shown]
        outlines = list(self._on_canvas(local[:, :2], np.maximum(depths, near))[corners])
        for cut in np.flatnonzero(depths[corners].min(axis=1) < near).tolist():
            outlines[cut] = self._cut(local[corners[cut]])
        colours = [scene.patch_light[index] for index in shown.tolist()]
        return list(zip(outlines, colours, strict=True))

    def _robot(self, faces: RobotFaces, rotation: NDArray[np.float64], lens: NDArray[np.float64]) -> list[_Face]:
        """List what of a robot's faces lies ahead of the lens."""
        local = (faces.corners - lens) @ rotation.T
        depths = local[:, 2]
        ahead = len(local) > 0 and depths.min() >= self.parameters.near_m
        fixed = self._on_canvas(local[:, :2], depths) if ahead else None
        found: list[_Face] = []
        first = 0
        for last, colour in zip(faces.ends, faces.colours, strict=True):
            outline = self._cut(local[first:last]) if fixed is None else fixed[first:last]
            if len(outline):
                found.append((outline, colour))
            first = last
        return found

    def _cut(self, corners: NDArray[np.float64]) -> NDArray[np.int32]:
        """Canvas coordinates of what lies ahead of a convex polygon (n, 3) of the optical frame; empty for nothing."""
        kept = clip_near(corners, self.parameters.near_m)
        return self._on_canvas(kept[:, :2], kept[:, 2]) if len(kept) > 2 else np.empty((0, 2), np.int32)

    def _on_canvas(self, points: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.int32]:
        """Fixed-point canvas coordinates (n, 2) of points (n, 2) of the optical frame at depths (n,) from `near_m`."""
        fixed = points * (self.parameters.focal_length_px / depths)[:, None]
        fixed += self._centre
        # Sample centres lie a quarter pixel around pixel centres; far-off corners stay inside OpenCV's integers.
        fixed *= SUPERSAMPLING << SHIFT
        fixed += 0.5 * (1 << SHIFT)
        np.minimum(fixed, 1e8, out=fixed)
        np.maximum(fixed, -1e8, out=fixed)
        return np.rint(fixed, out=fixed).astype(np.int32)

    def _first_row(self, faces: list[_Face]) -> int:
        """Row of the picture from which on there may be something other than the evenly lit wall."""
        last = self.parameters.height_px - 1
        if not faces:
            return last
        top = int(np.concatenate([outline for outline, _ in faces])[:, 1].min())
        return min(max(0, top // (SUPERSAMPLING << SHIFT) - _MARGIN_ROWS), last)

    def _sample(self, canvas: Light, light: Light) -> None:
        """Average the samples of these rows of the canvas and blur them, into the same rows of `light`."""
        size, blur_px = (light.shape[1], light.shape[0]), self.parameters.blur_px
        if not blur_px:
            cv2.resize(canvas, size, dst=light, interpolation=cv2.INTER_AREA)
            return
        sharp, blurred = self._sharp[: len(light)], self._blurred[: len(light)]
        cv2.resize(canvas, size, dst=sharp, interpolation=cv2.INTER_AREA)
        # OpenCV blurs floats twice as fast as 16-bit integers.
        np.copyto(blurred, sharp)
        cv2.GaussianBlur(blurred, (3, 3), blur_px, dst=blurred, borderType=cv2.BORDER_REPLICATE)
        np.copyto(light, np.rint(blurred, out=blurred), casting="unsafe")


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
