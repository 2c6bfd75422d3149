"""What a robot's camera sees: direct projection of the scene, and the sensor's noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.world.imperfections import generator
from robot_formation.world.parameters import CameraParameters, WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.scene import FULL, Scene

Picture = NDArray[np.uint8]

SUPERSAMPLING = 2
SHIFT = 6
"""Fractional bits of drawn coordinates."""


class Camera:
    """Pinhole camera on a robot: pictures without noise from `view`, with noise from `expose`.

    Image coordinates: integer (column, row) are pixel centres, origin top left. Light is computed linearly, averaged
    over 2 x 2 samples, blurred, and turned into 8 bits by the gamma curve (Pixy2 behaviour: exponent 1/1.5).
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
        self._levels = _level_table(p.gamma)
        self._bounds = _view_bounds(p)

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

    def view(self, robot: Pose, others: Sequence[Pose]) -> Picture:
        """Picture without noise, uint8 (rows, columns, 3) RGB, of a robot at `robot` that sees robots at `others`.

        Poses are base_link poses; no physics is involved.
        """
        return np.rint(self.light(robot, others)).astype(np.uint8)

    def light(self, robot: Pose, others: Sequence[Pose]) -> NDArray[np.float32]:
        """The same picture before rounding, float32 in 8-bit levels."""
        p = self.parameters
        rotation, lens = self.optical_frame(robot)
        canvas = self._canvas
        canvas[:] = np.asarray(self._scene.wall_light * FULL, np.uint16)
        self._draw_plate(lens, rotation)
        for other in sorted(others, key=lambda pose: -float(np.sum((np.asarray(pose.position) - lens) ** 2))):
            for world_corners, colour in self._scene.robot_faces(other, lens):
                self._fill((world_corners - lens) @ rotation.T, colour)
        small = cv2.resize(canvas, (p.width_px, p.height_px), interpolation=cv2.INTER_AREA)
        if p.blur_px > 0.0:
            cv2.GaussianBlur(small, (3, 3), p.blur_px, dst=small, borderType=cv2.BORDER_REPLICATE)
        light: NDArray[np.float32] = self._levels.take(small)
        return light

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


@lru_cache(maxsize=8)
def _level_table(gamma: float) -> NDArray[np.float32]:
    """8-bit level (not rounded) of every 16-bit linear light, shape (65536,)."""
    return (255.0 * (np.arange(65536) / FULL) ** (1.0 / gamma)).astype(np.float32)


@lru_cache(maxsize=8)
def _sigma_table(gamma: float, shot: float, read: float) -> NDArray[np.float32]:
    """Noise in 8-bit levels by level, shape (256,).

    Variance in linear light is shot * signal + read^2 (MT9M114 data sheet figures), mapped by the curve's slope.
    """
    light = np.maximum((np.arange(256) / 255.0) ** gamma, 1e-3)
    slope = 255.0 / gamma * light ** (1.0 / gamma - 1.0)
    return np.asarray(slope * np.sqrt(shot * light + read * read), np.float32)


class Sensor:
    """Noise of one robot's camera: depends on the seed, the robot and how many frames it has drawn, nothing else."""

    def __init__(self, parameters: CameraParameters, seed: int, robot: str) -> None:
        self._stream = generator(seed, robot, "camera")
        self._shape = (parameters.height_px, parameters.width_px, 3)
        self._size = parameters.height_px * parameters.width_px * 3
        self._pool = self._stream.standard_normal(3 * self._size, dtype=np.float32)
        self._sigmas = _sigma_table(parameters.gamma, parameters.shot_noise, parameters.read_noise)
        self._scratch = np.empty(self._shape, np.float32)

    def save(self) -> dict[str, Any]:
        """Take the state of the random stream."""
        return dict(self._stream.bit_generator.state)

    def restore(self, state: Mapping[str, Any]) -> None:
        """Put back what `save` took."""
        self._stream.bit_generator.state = dict(state)

    def sigma(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of every pixel and channel, in 8-bit levels, of a picture by `Camera.light`."""
        return np.asarray(cv2.LUT(light.astype(np.uint8), self._sigmas), np.float32)

    def expose(self, light: NDArray[np.float32], sigma: NDArray[np.float32]) -> Picture:
        """One noisy frame, uint8, of a picture and its `sigma`."""
        offset = int(self._stream.integers(0, 2 * self._size))
        noise = self._pool[offset : offset + self._size].reshape(self._shape)
        cv2.multiply(noise, sigma, dst=self._scratch)
        return np.asarray(cv2.add(light, self._scratch, dtype=cv2.CV_8U), np.uint8)
