"""The simulated world: robots on a surface, their cameras, and time that passes only while it owes something."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_formation.errors import FormationError
from robot_formation.parameters import suggestion
from robot_formation.surface import Surface
from robot_formation.world.bullet import pybullet
from robot_formation.world.camera import Camera, Picture, Sensor
from robot_formation.world.events import BodyState, Event, Frame, RobotPose
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import Pose
from robot_formation.world.robot import Robot, RobotStart

MAX_FRAMES_OWED = 600
WHEELS = 4


class WorldError(FormationError):
    """A command or request that the world refuses; nothing has moved."""


class World:
    """Robots on a surface, in steps of 1 / physics_hz.

    Time passes only in `advance`, and only while something is owed: a finite wheel motion, until wheels and body
    rest, or camera frames that were requested. The same surface, starts, parameters, seed and calls give the same
    events to the last bit.

    Attributes:
        step_count: physics steps since the start.
        parameters: the parameters in force.
        surface: the ground.
    """

    def __init__(
        self, surface: Surface, robots: Sequence[RobotStart], parameters: WorldParameters, *, seed: int
    ) -> None:
        """Put the robots on the surface, at rest.

        Raises:
            WorldError: if names repeat, robots overlap, or lockstep names an unknown robot.
        """
        names = [robot.name for robot in robots]
        _check_setup(names, parameters, seed)
        self.surface = surface
        self.parameters = parameters
        self.step_count = 0
        self._client: int = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=self._client)
        pybullet.setTimeStep(1.0 / parameters.physics_hz, physicsClientId=self._client)
        self._robots = {start.name: Robot(start, surface, parameters, seed, self._client) for start in robots}
        self._check_overlap()
        for robot in self._robots.values():
            robot.settle(lambda: pybullet.stepSimulation(physicsClientId=self._client))
        self._frame_steps = parameters.physics_hz // parameters.camera.frame_rate_hz
        self._state_steps = parameters.physics_hz // parameters.state_rate_hz
        self._pending: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {}
        self._frames_owed = {start.name: 0 for start in robots if start.camera}
        self._camera = Camera(surface, parameters)
        self._sensors = {name: Sensor(parameters.camera, seed, name) for name in self._frames_owed}
        self._pictures: dict[str, tuple[tuple[Pose, ...], NDArray[np.float32], NDArray[np.float32]]] = {}

    # --- asking -----------------------------------------------------------------------------------------------------

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots."""
        return tuple(self._robots)

    @property
    def stamp_ns(self) -> int:
        """Simulated time in nanoseconds, exact from the step counter."""
        return self.step_count * 10**9 // self.parameters.physics_hz

    @property
    def owes(self) -> bool:
        """Whether a motion isn't at rest or requested frames are outstanding."""
        return any(robot.moving for robot in self._robots.values()) or any(self._frames_owed.values())

    def ground_truth(self, robot: str) -> BodyState:
        """True state of base_link: pose in the world, velocities in world axes."""
        return self._robot(robot).body.state()

    # --- commanding -------------------------------------------------------------------------------------------------

    def command(self, robot: str, wheel_angles_rad: Sequence[float], speed_limits_rad_s: Sequence[float]) -> None:
        """Start one finite motion: turn the wheels by relative angles (FL, FR, RL, RR; rad), at most so fast (rad/s).

        A command during a motion replaces it; all zeros brake now (a hold: at least one step long). Robots named in
        the parameter lockstep start together, once each has a command.

        Raises:
            WorldError: on an unknown robot, a wrong number of values, a value that is not finite, or a speed or angle
                beyond the motor's limits. Nothing moves then.
        """
        target = self._robot(robot)
        angles, speeds = self._check_command(robot, wheel_angles_rad, speed_limits_rad_s)
        lockstep = self.parameters.lockstep
        if robot not in lockstep or (target.moving and not target.disturbed):
            target.begin(angles, speeds)
            return
        self._pending[robot] = (angles, speeds)
        if all(name in self._pending for name in lockstep):
            for name in lockstep:
                self._robots[name].begin(*self._pending.pop(name))

    def request_frames(self, robot: str, count: int) -> None:
        """Ask for `count` more frames of a robot's camera, stamped later than now.

        Raises:
            WorldError: on an unknown robot, one without camera, or too many frames.
        """
        self._robot(robot)
        if robot not in self._frames_owed:
            raise WorldError(f"robot '{robot}' has no camera; request frames of a robot that carries one")
        if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MAX_FRAMES_OWED:
            raise WorldError(f"robot '{robot}': can't give {count!r} frames; ask for 1 to {MAX_FRAMES_OWED}")
        owed = self._frames_owed[robot] + count
        if owed > MAX_FRAMES_OWED:
            raise WorldError(
                f"robot '{robot}': {owed} frames would be outstanding, more than {MAX_FRAMES_OWED}; take some first"
            )
        self._frames_owed[robot] = owed

    def advance(self) -> list[Event]:
        """Go on to the next instant at which something is published, and return it; empty if nothing is owed."""
        while self.owes:
            if any(robot.awake for robot in self._robots.values()):
                self._step_physics()
            elif any(robot.moving for robot in self._robots.values()):
                self.step_count += 1
            else:
                # All robots sleep: only the clock runs, up to the next frame.
                self.step_count += self._frame_steps - self.step_count % self._frame_steps
            events = self._motion_events()
            if self.step_count % self._frame_steps == 0:
                events += self._frames()
            if events:
                return events
        return []

    def close(self) -> None:
        """Free the physics engine; the world can't be used afterwards."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    # --- time -------------------------------------------------------------------------------------------------------

    def _step_physics(self) -> None:
        sleepers = []
        for robot in self._robots.values():
            if robot.awake:
                robot.body.apply_ground_forces()
            else:
                sleepers.append(robot)
        pybullet.stepSimulation(physicsClientId=self._client)
        self.step_count += 1
        for robot in sleepers:
            if robot.pushed():
                robot.disturb()

    def _motion_events(self) -> list[Event]:
        events: list[Event] = []
        due = self.step_count % self._state_steps == 0
        stamp = self.stamp_ns
        for name, robot in self._robots.items():
            if not robot.moving:
                continue
            final = robot.finished()
            if not (final or due):
                continue
            joints = robot.joint_states(stamp, final=final)
            if final or any(joints.velocities):
                events.append(joints)
            events.append(RobotPose(name, stamp, robot.body.state(), final))
        return events

    def _frames(self) -> list[Event]:
        stream = self.parameters.camera.mode == "stream"
        frames: list[Event] = []
        for name, owed in self._frames_owed.items():
            if owed or stream:
                frames.append(Frame(name, self.stamp_ns, self._take_picture(name)))
                self._frames_owed[name] = max(0, owed - 1)
        return frames

    def _take_picture(self, name: str) -> Picture:
        poses = {other: robot.body.pose() for other, robot in self._robots.items()}
        key = tuple(poses.values())
        sensor = self._sensors[name]
        cached = self._pictures.get(name)
        if cached is None or cached[0] != key:
            light = self._camera.light(poses[name], [pose for other, pose in poses.items() if other != name])
            cached = (key, light, sensor.sigma(light))
            self._pictures[name] = cached
        return sensor.expose(cached[1], cached[2])

    # --- checks -----------------------------------------------------------------------------------------------------

    def _robot(self, name: str) -> Robot:
        robot = self._robots.get(name)
        if robot is None:
            raise WorldError(f"no robot '{name}'{suggestion(name, self._robots)}")
        return robot

    def _check_command(
        self, robot: str, angles: Sequence[float], speeds: Sequence[float]
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        motor = self.parameters.motor
        checked = tuple(float(value) for value in angles), tuple(float(value) for value in speeds)
        if any(len(values) != WHEELS for values in checked):
            raise WorldError(
                f"robot '{robot}': a command needs four wheel angles and four speed limits, "
                f"not {len(checked[0])} and {len(checked[1])}"
            )
        if not all(math.isfinite(value) for values in checked for value in values):
            raise WorldError(f"robot '{robot}': wheel angles and speed limits must be finite numbers")
        for angle, speed in zip(*checked, strict=True):
            if abs(angle) > motor.max_angle_rad:
                raise WorldError(
                    f"robot '{robot}': a wheel angle of {angle:g} rad is beyond {motor.max_angle_rad:g} rad; split it"
                )
            if angle != 0.0 and not 0.0 < speed <= motor.max_speed_rad_s:
                raise WorldError(
                    f"robot '{robot}': a speed limit of {speed:g} rad/s is outside what the motor can do; "
                    f"give more than 0 and at most {motor.max_speed_rad_s:g} rad/s"
                )
        return checked

    def _check_overlap(self) -> None:
        robots = list(self._robots.values())
        for i, a in enumerate(robots):
            for b in robots[i + 1 :]:
                if pybullet.getClosestPoints(a.body.index, b.body.index, 0.0, physicsClientId=self._client):
                    self.close()
                    raise WorldError(f"robots '{a.name}' and '{b.name}' overlap at their starts; move them apart")


def _check_setup(names: Sequence[str], parameters: WorldParameters, seed: int) -> None:
    for name in names:
        if not name or names.count(name) > 1:
            raise WorldError(f"robot names must be non-empty and different; '{name}' is not")
    for name in parameters.lockstep:
        if name not in names:
            raise WorldError(f"world: 'lockstep' names no robot '{name}'{suggestion(name, names)}")
    if seed < 0:
        raise WorldError(f"the seed must be 0 or larger, not {seed}")
