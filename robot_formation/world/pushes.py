"""Pushes: somebody moves a robot by hand, without turning its wheels, so that no encoder tells of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_formation.errors import shown
from robot_formation.geometry.orientation import quaternion
from robot_formation.parameters import ParameterError, suggestion
from robot_formation.surface import Surface
from robot_formation.world.parameters import WheelParameters
from robot_formation.world.pose import Pose, pose_on_surface

LONGEST_M = 0.1
"""Longest push along each axis; neighbours' bodies are 8 cm apart in formation."""
_FORM = "robot timestep x_m y_m, like follower_2 8 0.03 0.0"


@dataclass(frozen=True)
class Push:
    """A robot is displaced in its own frame, x forward and y left, when the leader's move of a timestep has ended."""

    robot: str
    timestep: int
    x_m: float
    y_m: float

    @property
    def text(self) -> str:
        """The push as a ROS parameter holds it."""
        return f"{self.robot} {self.timestep} {self.x_m!r} {self.y_m!r}"


def read_push(text: str, where: str = "world: 'pushes'") -> Push:
    """Read a push from its text.

    Raises:
        ParameterError: if it is none, or too long.
    """
    parts = text.split()
    try:
        robot, timestep, x_m, y_m = parts[0], int(parts[1]), float(parts[2]), float(parts[3])
    except (IndexError, ValueError):
        parts = []
    if len(parts) != 4:
        raise ParameterError(f"{where}: {shown(text)} is no push; write {_FORM}")
    if not all(math.isfinite(part) and abs(part) <= LONGEST_M for part in (x_m, y_m)):
        raise ParameterError(f"{where}: {shown(text)} is longer than {LONGEST_M} m along an axis")
    return Push(robot, timestep, x_m, y_m)


def check_push(push: Push, robots: tuple[str, ...], timesteps: int, where: str = "world: 'pushes'") -> None:
    """Check that a push can happen in a run.

    Raises:
        ParameterError: if there is no such robot or timestep.
    """
    if push.robot not in robots:
        raise ParameterError(f"{where}: no robot '{push.robot}'{suggestion(push.robot, robots)}")
    if not 1 <= push.timestep <= timesteps:
        raise ParameterError(f"{where}: timestep {push.timestep} is outside 1 to {timesteps}, the run's timesteps")


def displaced(pose: Pose, surface: Surface, push: Push, wheels: WheelParameters) -> Pose:
    """Return where a robot stands after a push: its wheels stay as deep in the ground as they were."""
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x, y, z = pose.position
    to_x, to_y = x + c * push.x_m - s * push.y_m, y + s * push.x_m + c * push.y_m
    before, after = (
        pose_on_surface(surface, at_x, at_y, pose.yaw_rad, wheelbase_m=wheels.wheelbase_m, track_m=wheels.track_m)
        for at_x, at_y in ((x, y), (to_x, to_y))
    )
    orientation = quaternion(
        pose.roll_rad + after.roll_rad - before.roll_rad,
        pose.pitch_rad + after.pitch_rad - before.pitch_rad,
        pose.yaw_rad,
    )
    return Pose((to_x, to_y, z + after.position[2] - before.position[2]), orientation)
