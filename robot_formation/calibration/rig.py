"""A calibration rig: one robot alone in the middle of the plate, and an observer who measures its drives.

The observer uses the paper's one-point reference: the white dot on the robot's top, seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import TracebackType

import numpy as np

from robot_formation.drive.curves import CalibrationError
from robot_formation.drive.movement_system import LEG_SIGNS, Drive
from robot_formation.geometry.se2 import Motion
from robot_formation.names import JOINTS, WHEELS
from robot_formation.surface import Surface
from robot_formation.world.events import JointStates
from robot_formation.world.imperfections import generator
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.start import RobotStart
from robot_formation.world.world import World

LEGS = {"v": "x", "u": "y", "turn": "yaw"}
"""Legs of the drive by calibrated axis."""


@dataclass(frozen=True)
class CalibrationRig:
    """What every robot is measured on: ground, robots' parameters and seed, and the observer's error.

    Args:
        surface: the ground; robots start in the plate's middle.
        parameters: of the world; only the robots' matter.
        seed: draws each robot's own motors, radii and stops, and the observer's error.
        reference_noise_m: standard deviation of the observer's x and y at each stop, m. Headings are exact.
    """

    surface: Surface
    parameters: WorldParameters
    seed: int
    reference_noise_m: float = 0.0


@dataclass(frozen=True)
class Observation:
    """A drive as measured: the dot's way (x, y) as seen from above [m], the turn [rad], the wheels' encoders [rad]."""

    way_m: tuple[float, float]
    turn_rad: float
    wheels_rad: tuple[float, ...]

    @property
    def distance_m(self) -> float:
        """How far the dot went."""
        return math.hypot(*self.way_m)


class RobotOnRig:
    """A robot of the rig, in a world of its own; a context manager."""

    def __init__(self, rig: CalibrationRig, robot: str) -> None:
        middle = 0.5 * rig.surface.size_m
        start = RobotStart(robot, middle, middle, 0.0, camera=False)
        self.robot = robot
        self._rig = rig
        self._world = World(rig.surface, [start], replace(rig.parameters, lockstep=()), seed=rig.seed)
        self._noise = generator(rig.seed, robot, "calibration reference")
        self._joints: Sequence[float] = (0.0,) * len(JOINTS)
        self._dot, self._heading = self._look()

    def __enter__(self) -> RobotOnRig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._world.close()

    def turn_wheels(self, axis: str, rotation_rad: float, speed_rad_s: float) -> Observation:
        """Turn the wheels by a rotation along an axis (v forward, u to the left, turn anticlockwise if positive).

        Raises:
            CalibrationError: if the robot doesn't come to rest or leaves the plate.
        """
        angles = tuple(rotation_rad * sign for sign in LEG_SIGNS[LEGS[axis]])
        before = self._joints
        self._run(angles, (speed_rad_s,) * len(WHEELS))
        return self._observe(before)

    def move(self, drive: Drive, target: Motion) -> tuple[Observation, Motion]:
        """Let the robot's drive make a move; return what the observer and what the sensing system say of it.

        Raises:
            CalibrationError: if the drive refuses the move, the robot doesn't come to rest or leaves the plate.
        """
        before = self._joints
        drive.joint_states(self._world.stamp_ns, before, (0.0,) * len(JOINTS))  # it may know nothing of earlier drives
        action = drive.move(target)
        while action.command is not None:
            if action.warning:
                raise CalibrationError(f"{self.robot}: {action.warning}")
            final = self._run(action.command.angles_rad, action.command.limits_rad_s)
            action = drive.joint_states(final.stamp_ns, final.positions, final.velocities)
        assert action.moved is not None  # a drive at rest without further legs has moved
        return self._observe(before), action.moved

    def _run(self, angles: Sequence[float], limits: Sequence[float]) -> JointStates:
        self._world.command(self.robot, angles, limits)
        final = None
        while events := self._world.advance():
            final = next((e for e in events if isinstance(e, JointStates) and e.final), final)
        if final is None or final.timed_out:
            raise CalibrationError(
                f"{self.robot}: the wheels didn't finish a drive; raise world.motion_timeout_s or "
                "drive.wheel_speed_rad_s"
            )
        self._joints = final.positions
        return final

    def _observe(self, before: Sequence[float]) -> Observation:
        dot, heading = self._look()
        turn = math.remainder(heading - self._heading, math.tau)
        wheels = tuple(b - a for a, b in zip(before[: len(WHEELS)], self._joints[: len(WHEELS)], strict=True))
        observation = Observation((dot[0] - self._dot[0], dot[1] - self._dot[1]), turn, wheels)
        self._dot, self._heading = dot, heading
        return observation

    def _look(self) -> tuple[tuple[float, float], float]:
        """Read where the dot is, with the observer's error, and the heading."""
        pose = self._world.ground_truth(self.robot).pose
        dot = np.asarray(pose.position) + pose.matrix() @ (0.0, 0.0, self._rig.parameters.marker.top_m)
        if not all(0.0 <= value <= self._rig.surface.size_m for value in dot[:2]):
            raise CalibrationError(f"{self.robot} has left the plate; calibrate on level ground, or on a larger plate")
        x, y = dot[:2] + self._rig.reference_noise_m * self._noise.standard_normal(2)
        return (float(x), float(y)), pose.yaw_rad
