"""Pictures to teach the camera's signatures with: one face of the marker, seen squarely in formation."""

from __future__ import annotations

import math

from robot_formation.surface import Plane
from robot_formation.world.camera import Camera, RenderedPicture
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.sensor import Sensor

FACE_TURNS = {"target": 0.0, "front": -0.5 * math.pi, "rear": 0.5 * math.pi}
"""Heading of the seen robot, relative to the one that looks, that turns the face to the camera."""


def marker_picture(
    parameters: WorldParameters, face: str = "target", *, seed: int = 0, distance_m: float = 0.32
) -> RenderedPicture:
    """First picture that a camera takes of a face of the marker on level ground, uint8 (rows, columns, 3) RGB.

    The robots' origins are `distance_m` apart with the seen robot on the left, so that at the formation's 0.32 m the
    face is about 50 px wide, in the middle, and about 50 px above the picture's centre.

    Args:
        parameters: those of the world whose camera is taught.
        face: "target", "front" or "rear".
        seed: of the sensor noise.
        distance_m: from origin to origin.
    """
    plane = Plane()
    middle = 0.5 * plane.size_m
    looking = pose_on_surface(plane, middle, middle - 0.5 * distance_m, 0.0)
    seen = pose_on_surface(plane, middle, middle + 0.5 * distance_m, FACE_TURNS[face])
    light = Camera(plane, parameters).light(looking, [seen])
    sensor = Sensor(parameters.camera, seed, f"teaching {face}")
    return sensor.expose(sensor.develop(light), 0.0)
