"""What the world publishes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.orientation import Vector
from robot_formation.world.pose import Pose


@dataclass(frozen=True)
class BodyState:
    """True pose of base_link, and its velocity in the world frame."""

    pose: Pose
    linear_m_s: Vector
    angular_rad_s: Vector

    @property
    def x_m(self) -> float:
        """World x of base_link's origin."""
        return self.pose.position[0]

    @property
    def y_m(self) -> float:
        """World y of base_link's origin."""
        return self.pose.position[1]

    @property
    def z_m(self) -> float:
        """World z of base_link's origin."""
        return self.pose.position[2]

    @property
    def yaw_rad(self) -> float:
        """Heading, counter-clockwise from world x."""
        return self.pose.yaw_rad


@dataclass(frozen=True)
class JointStates:
    """Joint positions (rad, since the start, in whole encoder counts) and velocities (rad/s) of one robot.

    All velocities are exactly 0.0 in the final message of a motion, and only there. `timed_out`: the motion was
    braked because it took longer than `motion_timeout_s`.
    """

    robot: str
    stamp_ns: int
    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    final: bool
    timed_out: bool = False


@dataclass(frozen=True)
class RobotPose:
    """Ground truth of one robot."""

    robot: str
    stamp_ns: int
    state: BodyState
    final: bool


@dataclass(frozen=True, eq=False)
class Frame:
    """Camera picture of one robot, uint8 (rows, columns, 3), red, green, blue."""

    robot: str
    stamp_ns: int
    image: NDArray[np.uint8]


@dataclass(frozen=True)
class LeftPlate:
    """A robot's reference dot has left the plate, seen from above; (x_m, y_m) is where it is in the world.

    The robot is held there and takes no more commands.
    """

    robot: str
    stamp_ns: int
    x_m: float
    y_m: float


Event: TypeAlias = JointStates | RobotPose | Frame | LeftPlate
