"""The visible world as convex faces with their linear light: wall, plate, robots with their markers."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from robot_formation.surface import Surface
from robot_formation.vision.marker import MarkerKind
from robot_formation.world.parameters import MarkerParameters, WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.tag_faces import FACES, tag_rectangles

Array = NDArray[np.float64]
Colour = tuple[float, float, float]
_Value = TypeVar("_Value", bound=np.generic)

FULL = 65535.0
"""Linear light 1 in the 16-bit drawing."""
PEDESTAL_M = 0.03
"""Edge of the post between body and marker."""
BACKDROP_THICKNESS_M = 0.002

_BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_SIDES: tuple[tuple[tuple[int, int, int, int], tuple[float, float, float]], ...] = (
    ((4, 5, 7, 6), (1.0, 0.0, 0.0)),
    ((0, 1, 3, 2), (-1.0, 0.0, 0.0)),
    ((2, 3, 7, 6), (0.0, 1.0, 0.0)),
    ((0, 1, 5, 4), (0.0, -1.0, 0.0)),
    ((1, 3, 7, 5), (0.0, 0.0, 1.0)),
)
"""Corner indices and normals: front, rear, left, right, top (the bottom is never seen)."""


def board_y_m(marker: MarkerParameters) -> float:
    """Y of the middle of the board behind the marker, in base_link."""
    return 0.5 * (marker.edge_m + BACKDROP_THICKNESS_M)


def _box_around(points: Array) -> Array:
    """Corners (8, 3) of the box, along the axes, around points (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(0.5 * (low + high) + _BOX * (high - low))


class RobotFaces(NamedTuple):
    """Convex faces of a robot.

    Attributes:
        corners: corners of all faces in the world, one face after the other, (n, 3), metres.
        ends: where the corners of each face end.
        colours: linear light of each face.
    """

    corners: Array
    ends: list[int]
    colours: list[Colour]


class Scene:
    """Faces to draw, with ambient light and one lamp (Lambert); light is linear, 65535 is white where fully lit.

    Attributes:
        wall_light: linear light of the evenly lit background, 0 to 1.
        plate_points: corners of the plate's patches in the world, (n, 3), metres.
        patch_corners: indices of each patch's four corners, (patches, 4); patches are in rows along y.
        patch_light: red, green, blue of each patch.
        robot_middle: in the middle of a robot, (3,) in its base_link frame.
        robot_radius_m: farthest from there that any of its faces reaches.
        robot_boxes: corners of the boxes around a robot's body and around what stands on it, (2, 8, 3) in its base_link
            frame.
    """

    def __init__(self, surface: Surface, parameters: WorldParameters) -> None:
        camera, marker, chassis = parameters.camera, parameters.marker, parameters.chassis
        lamp = np.array([camera.light_x, camera.light_y, camera.light_z])
        self._lamp = lamp / np.linalg.norm(lamp)
        self._ambient = camera.ambient
        self.wall_light = camera.wall_albedo / 255.0
        grey = marker.body_rgb
        body = (chassis.length_m, chassis.width_m, chassis.body_top_m - chassis.body_bottom_m)
        foot = marker.top_m - marker.edge_m
        self._faces: list[tuple[Array, Array, Array]] = []
        self._add_box(body, chassis.body_bottom_m, (grey,) * 5)
        if foot > chassis.body_top_m:
            self._add_box((PEDESTAL_M, PEDESTAL_M, foot - chassis.body_top_m), chassis.body_top_m, (grey,) * 5)
        if marker.backdrop_m > 0.0:
            board = (marker.backdrop_m, BACKDROP_THICKNESS_M, marker.top_m - chassis.body_top_m)
            self._add_box(board, chassis.body_top_m, (marker.backdrop_rgb,) * 5, y_m=board_y_m(marker))
        target, front, rear = marker.face_colours
        self._add_box((marker.edge_m,) * 3, foot, (front, rear, grey, target, grey))
        if marker.kind is MarkerKind.TAGS:
            for face in FACES:
                for corners, normal, light in tag_rectangles(face, marker.edge_m, marker.top_m - 0.5 * marker.edge_m):
                    self._add_face(corners, normal, marker.tag_light_rgb if light else marker.tag_dark_rgb)
        around = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        dot = np.stack([np.cos(around), np.sin(around), np.zeros(16)], axis=1) * marker.dot_radius_m
        self._add_face(dot + np.array([0.0, 0.0, marker.top_m]), np.array([0.0, 0.0, 1.0]), marker.dot_rgb)
        self._stack_faces()
        self._make_plate(surface, camera.plate_patches, camera.plate_albedo)

    def _add_box(
        self, size: tuple[float, ...], bottom: float, colours: tuple[tuple[int, ...], ...], *, y_m: float = 0.0
    ) -> None:
        corners = _BOX * size + [0.0, y_m, bottom + 0.5 * size[2]]
        for (indices, normal), colour in zip(_SIDES, colours, strict=True):
            self._add_face(corners[list(indices)], np.array(normal), colour)

    def _add_face(self, corners: Array, normal: Array, colour: tuple[int, ...]) -> None:
        self._faces.append((corners, normal, np.array(colour) / 255.0))

    def _stack_faces(self) -> None:
        """Put all faces into arrays, to be turned and lit at once."""
        self._counts = np.array([len(corners) for corners, _, _ in self._faces])
        self._corners = np.concatenate([corners for corners, _, _ in self._faces])
        self._normals = np.stack([normal for _, normal, _ in self._faces])
        self._albedos = np.stack([albedo for _, _, albedo in self._faces])
        self._heights = np.array([normal @ corners[0] for corners, normal, _ in self._faces])
        self.robot_middle = 0.5 * (self._corners.min(axis=0) + self._corners.max(axis=0))
        body = int(self._counts[: len(_SIDES)].sum())
        self.robot_boxes = np.stack([_box_around(self._corners[:body]), _box_around(self._corners[body:])])
        self.robot_radius_m = float(np.linalg.norm(self._corners - self.robot_middle, axis=1).max())

    def over_patches(self, combine: np.ufunc, values: NDArray[_Value]) -> NDArray[_Value]:
        """Combine values at the plate's points into one per patch, of its four corners."""
        grid = values.reshape(self._edge_points, self._edge_points)
        sides = combine(grid[:, :-1], grid[:, 1:])
        return np.asarray(combine(sides[:-1], sides[1:])).ravel()

    def _make_plate(self, surface: Surface, patches: int, albedo: int) -> None:
        edge = np.linspace(0.0, surface.size_m, patches + 1)
        self._edge_points = len(edge)
        xs, ys = np.meshgrid(edge, edge, indexing="ij")
        self.plate_points = np.stack([xs, ys, surface.heights(xs, ys)], axis=-1).reshape(-1, 3)
        middles = 0.5 * (edge[1:] + edge[:-1])
        corners: list[list[int]] = []
        self.patch_light: list[Colour] = []
        for i, x in enumerate(middles):
            for j, y in enumerate(middles):
                first = i * (patches + 1) + j
                corners.append([first, first + 1, first + patches + 2, first + patches + 1])
                # Two slightly different greys make the patches visible without colour.
                tone = albedo / 255.0 * (1.0 if (i + j) % 2 else 0.96)
                normal = np.array(surface.normal(float(x), float(y)))
                self.patch_light.append(self._shade(normal, np.full(3, tone)))
        self.patch_corners = np.array(corners)

    def _shade(self, normal: Array, albedo: Array) -> Colour:
        """Linear light of a face in 16-bit units."""
        r, g, b = self._lit(normal[None], albedo[None])[0].tolist()
        return (r, g, b)

    def _lit(self, normals: Array, albedos: Array) -> Array:
        """Linear light (n, 3) of faces in 16-bit units, by their normals (n, 3) in the world and albedos (n, 3)."""
        light = self._ambient + (1.0 - self._ambient) * np.maximum(0.0, normals @ self._lamp)
        return np.asarray(albedos * (light * FULL)[:, None])

    def robot_faces(self, robot: Pose, lens: Array) -> RobotFaces:
        """Faces of a robot that are turned to the lens, in drawing order: body, post, marker."""
        rotation, position = robot.matrix(), np.asarray(robot.position)
        eye = rotation.T @ (lens - position)
        turned = self._normals @ eye > self._heights
        corners = self._corners[np.repeat(turned, self._counts)] @ rotation.T + position
        light = self._lit(self._normals[turned] @ rotation.T, self._albedos[turned])
        return RobotFaces(corners, np.cumsum(self._counts[turned]).tolist(), [(r, g, b) for r, g, b in light.tolist()])
