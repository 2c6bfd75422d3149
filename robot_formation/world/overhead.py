"""The camera above the plate: what it sees, through its lens and with its noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.vision.luminance import LUMINANCE_WEIGHTS
from robot_formation.world.imperfections import generator
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.scene import FULL, Colour, Scene

GreyPicture = NDArray[np.uint8]

SUPERSAMPLING = 4
SHIFT = 6
"""Fractional bits of drawn coordinates."""
_LUMINANCE = LUMINANCE_WEIGHTS / FULL
_MARGIN_PX = 3
_BLUR_REACH_PX = 1
_NEAREST_M = 0.25
"""Robots nearer below the lens are not drawn."""
_STRAIGHT_DOWN = np.diag([1.0, -1.0, -1.0])


class _Outlines(NamedTuple):
    """A robot's visible faces, in drawing order.

    Attributes:
        corners: corners of all faces, one face after the other, (n, 2) in pixels.
        corners_fixed: the same on the canvas, fixed-point.
        ends: where the corners of each face end.
        levels: grey level of each face.
        distance_m: of the robot from the lens.
    """

    corners: NDArray[np.float64]
    corners_fixed: NDArray[np.int32]
    ends: list[int]
    levels: list[float]
    distance_m: float


class OverheadCamera:
    """Grey pictures from above, 8 bits by the gamma curve of the robots' cameras; white in full light is 255.

    Image coordinates: integer (column, row) are pixel centres, origin top left; columns grow along the world's x, rows
    against its y. A picture depends on the seed, the poses and its number and on nothing else: not on earlier pictures.
    """

    def __init__(self, surface: Surface, parameters: WorldParameters, seed: int) -> None:
        self.parameters = p = parameters.overhead
        self._scene = Scene(surface, parameters)
        self._lens = np.array([p.x_m, p.y_m, p.z_m])
        f = p.focal_length_px
        self._matrix = np.array([[f, 0.0, p.centre_x_px], [0.0, f, p.centre_y_px], [0.0, 0.0, 1.0]])
        self._distortion = np.array([p.k1, p.k2, p.p1, p.p2, p.k3])
        self._seed = seed
        self._size = p.width_px * p.height_px
        self._widest = 2.0 * math.hypot(p.width_px, p.height_px) / p.focal_length_px
        self._gamma = parameters.camera.gamma
        self._canvas = self._empty_plate(p.floor_albedo / 255.0)
        self._picture = self._sampled(self._canvas)
        self._drawn: dict[Pose, _Outlines] = {}
        drawn = generator(seed, "overhead", "camera").standard_normal(2 * self._size, dtype=np.float32)
        drawn *= np.float32(p.noise)
        self._pool = np.rint(np.clip(drawn, -127, 127, out=drawn), out=drawn).astype(np.int8)

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Exact image (n, 2) in pixels (column, row), distortion included, of world points (n, 3) below the lens."""
        local = (np.asarray(points, float) - self._lens) @ _STRAIGHT_DOWN
        zero = np.zeros(3)
        pixels, _ = cv2.projectPoints(local.reshape(-1, 1, 3), zero, zero, self._matrix, self._distortion)
        return np.asarray(pixels, np.float64).reshape(-1, 2)

    def view(self, robots: Sequence[Pose]) -> GreyPicture:
        """Picture without noise, uint8 (rows, columns), of robots at these base_link poses."""
        return np.array(self._current(robots))

    def frame(self, robots: Sequence[Pose], number: int) -> GreyPicture:
        """Picture with noise; `number` tells the frames of a run apart (the world's step)."""
        offset = int(generator(self._seed, "overhead", f"frame {number}").integers(0, self._size))
        noise = self._pool[offset : offset + self._size].reshape(self._picture.shape)
        return np.asarray(cv2.add(self._current(robots), noise, dtype=cv2.CV_8U), np.uint8)

    def _current(self, robots: Sequence[Pose]) -> GreyPicture:
        """Bring the picture up to date: only what has changed is drawn, the result is the same as if all were."""
        before, drawn = self._drawn, {pose: self._drawn.get(pose) or self._outlines(pose) for pose in robots}
        self._drawn = drawn
        changed = [(before | drawn)[pose] for pose in before.keys() ^ drawn.keys()]
        corners = [outlines.corners for outlines in changed if len(outlines.corners)]
        if corners:
            self._draw_part(np.concatenate(corners), sorted(drawn.values(), key=lambda o: -o.distance_m))
        return self._picture

    def _outlines(self, robot: Pose) -> _Outlines:
        x, y, z = (a - b for a, b in zip(robot.position, self._lens.tolist(), strict=True))
        distance = math.hypot(x, y, z)
        # Far outside the picture the lens model is not defined.
        if z > -_NEAREST_M or math.hypot(x, y) > -z * self._widest:
            return _Outlines(np.empty((0, 2)), np.empty((0, 2), np.int32), [], [], distance)
        faces = self._scene.robot_faces(robot, self._lens)
        corners = self.project(faces.corners)
        levels = [self._level(colour) for colour in faces.colours]
        return _Outlines(corners, _on_canvas(corners), faces.ends, levels, distance)

    def _draw_part(self, corners: NDArray[np.float64], robots: Sequence[_Outlines]) -> None:
        """Draw the part of the picture that holds these corners anew, with all robots, far to near."""
        p, s = self.parameters, SUPERSAMPLING
        limits = (p.width_px, p.height_px)
        left, top = np.maximum(np.floor(corners.min(axis=0)).astype(int) - _MARGIN_PX, 0).tolist()
        right, bottom = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + _MARGIN_PX, limits).tolist()
        if left >= right or top >= bottom:
            return
        # The blur at the part's edge needs pixels beyond it.
        x, y = max(0, left - _BLUR_REACH_PX), max(0, top - _BLUR_REACH_PX)
        part = (slice(y * s, (bottom + _BLUR_REACH_PX) * s), slice(x * s, (right + _BLUR_REACH_PX) * s))
        # A second canvas would take 4 MB: the plate under the robots is kept, and put back.
        hidden = [(where, self._canvas[where].copy()) for where in map(self._covered, robots)]
        # On the whole canvas: OpenCV's lines depend on where they are clipped.
        for outlines in robots:
            first = 0
            for last, level in zip(outlines.ends, outlines.levels, strict=True):
                cv2.fillConvexPoly(
                    self._canvas, outlines.corners_fixed[first:last], level, lineType=cv2.LINE_8, shift=SHIFT
                )
                first = last
        small = self._sampled(self._canvas[part])
        self._picture[top:bottom, left:right] = small[top - y : bottom - y, left - x : right - x]
        for where, plate in hidden:
            self._canvas[where] = plate

    def _covered(self, robot: _Outlines) -> tuple[slice, slice]:
        """Rows and columns of the canvas that a robot's faces may cover."""
        if not len(robot.corners_fixed):
            return slice(0), slice(0)
        first = (robot.corners_fixed.min(axis=0) >> SHIFT) - _MARGIN_PX
        last = (robot.corners_fixed.max(axis=0) >> SHIFT) + _MARGIN_PX + 1
        left, top = np.maximum(first, 0).tolist()
        right, bottom = np.maximum(last, 0).tolist()
        return slice(top, bottom), slice(left, right)

    def _empty_plate(self, floor_light: float) -> GreyPicture:
        p = self.parameters
        shape = (p.height_px * SUPERSAMPLING, p.width_px * SUPERSAMPLING)
        canvas = np.full(shape, round(self._level((floor_light * FULL,) * 3)), np.uint8)
        fixed = _on_canvas(self.project(self._scene.plate_points))
        for corners, light in zip(self._scene.patch_corners, self._scene.patch_light, strict=True):
            cv2.fillConvexPoly(canvas, fixed[corners], self._level(light), lineType=cv2.LINE_8, shift=SHIFT)
        return canvas

    def _level(self, light: Colour) -> float:
        """8-bit grey level of a linear light."""
        return float(255.0 * np.dot(light, _LUMINANCE) ** (1.0 / self._gamma))

    def _sampled(self, canvas: GreyPicture) -> GreyPicture:
        size = (canvas.shape[1] // SUPERSAMPLING, canvas.shape[0] // SUPERSAMPLING)
        small = cv2.resize(canvas, size, interpolation=cv2.INTER_AREA)
        if self.parameters.blur_px > 0.0:
            small = cv2.GaussianBlur(small, (3, 3), self.parameters.blur_px, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(small, np.uint8)


def _on_canvas(pixels: NDArray[np.float64]) -> NDArray[np.int32]:
    """Fixed-point canvas coordinates (n, 2) of pixels (n, 2)."""
    # Sample centres lie around pixel centres; far-off corners stay inside OpenCV's integers.
    samples = (pixels + 0.5) * SUPERSAMPLING - 0.5
    return np.rint(np.clip(samples * (1 << SHIFT), -1e8, 1e8)).astype(np.int32)
