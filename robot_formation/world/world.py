"""The simulated world: robots on a surface, their cameras, and time that passes only while it owes something."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import NamedTuple

from robot_formation.parameters import suggestion
from robot_formation.surface import Surface
from robot_formation.world.bullet import pybullet
from robot_formation.world.camera import Camera, RenderedPicture
from robot_formation.world.checks import Command, WorldError, check_command, check_setup
from robot_formation.world.events import BodyState, Event, Frame, JointStates, LeftPlate, RobotPose
from robot_formation.world.parameters import CameraMode, WorldParameters
from robot_formation.world.pose import Pose, off_plate
from robot_formation.world.pushes import Push, displaced
from robot_formation.world.robot import Robot
from robot_formation.world.sensor import Development, Sensor
from robot_formation.world.start import RobotStart

MAX_FRAMES_OWED = 600
_read_contacts = pybullet.getContactPoints


class _Picture(NamedTuple):
    """A robot's last picture before noise, for as long as nothing in view moves.

    Attributes:
        everyone: poses of all robots, by which it is told at once that nothing has moved.
        seen: of the robot itself, then of those that it may see.
        development: the picture.
    """

    everyone: list[Pose]
    seen: list[Pose]
    development: Development


class World:
    """Robots on a surface, in steps of 1 / physics_hz.

    Time passes only in `advance`, and only while something is owed: a finite wheel motion, until wheels and body
    rest; camera frames that were requested; or a time up to which it is to go on. The same surface, starts, parameters,
    seed and calls give the same events to the last bit.

    Attributes:
        step_count: physics steps since the start.
        start_ns: simulated time at the start, nanoseconds.
        parameters: the parameters in force.
        surface: the ground.
    """

    def __init__(
        self,
        surface: Surface,
        robots: Sequence[RobotStart],
        parameters: WorldParameters,
        *,
        seed: int,
        start_ns: int = 0,
    ) -> None:
        """Put the robots on the surface, at rest, at the simulated time `start_ns`.

        Raises:
            WorldError: if names repeat, robots overlap or would start beyond the plate, or lockstep names an unknown
                robot.
        """
        check_setup(surface, robots, parameters, seed)
        self.start_ns = start_ns
        self.surface = surface
        self.parameters = parameters
        self.step_count = 0
        self._client: int = pybullet.connect(pybullet.DIRECT)
        self._free = weakref.finalize(self, pybullet.disconnect, physicsClientId=self._client)
        pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=self._client)
        pybullet.setTimeStep(1.0 / parameters.physics_hz, physicsClientId=self._client)
        self._robots = {start.name: Robot(start, surface, parameters, seed, self._client) for start in robots}
        self._check_overlap()
        for robot in self._robots.values():
            robot.settle(lambda: pybullet.stepSimulation(physicsClientId=self._client))
        for robot in self._robots.values():
            robot.body.read_pose()
        self._frame_steps = parameters.physics_hz // parameters.camera.min_frames_per_second
        self._state_steps = parameters.physics_hz // parameters.state_rate_hz
        self._pending: dict[str, Command] = {}
        self._frames_owed = {start.name: 0 for start in robots if start.camera}
        self._camera = Camera(surface, parameters)
        self._sensors = {name: Sensor(parameters.camera, seed, name) for name in self._frames_owed}
        self._pictures: dict[str, _Picture] = {}
        self._owed_until = 0  # step up to which time goes on by itself

    # --- asking -----------------------------------------------------------------------------------------------------

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots."""
        return tuple(self._robots)

    @property
    def stamp_ns(self) -> int:
        """Simulated time in nanoseconds, exact from the step counter."""
        return self.start_ns + self.step_count * 10**9 // self.parameters.physics_hz

    @property
    def owes(self) -> bool:
        """Whether a motion isn't at rest, requested frames are outstanding, or time was asked for."""
        return self._owes()

    @property
    def at_rest(self) -> bool:
        """Whether no robot is in a motion."""
        return not any(robot.moving for robot in self._robots.values())

    def ground_truth(self, robot: str) -> BodyState:
        """True state of base_link: pose in the world, velocities in world axes."""
        return self._robot(robot).body.state()

    def joint_states(self, robot: str) -> JointStates:
        """What a standing robot's encoders say."""
        return self._robot(robot).joint_states(self.stamp_ns, final=True)

    # --- commanding -------------------------------------------------------------------------------------------------

    def command(self, robot: str, wheel_angles_rad: Sequence[float], speed_limits_rad_s: Sequence[float]) -> None:
        """Start one finite motion: turn the wheels by relative angles (FL, FR, RL, RR; rad), at most so fast (rad/s).

        A command during a motion replaces it; all zeros brake now (a hold: at least one step long). Robots named in
        the parameter lockstep start together, once each has a command.

        Raises:
            WorldError: on an unknown robot, one that has left the plate, a wrong number of values, a value that is not
                finite, or a speed or angle beyond the motor's limits. Nothing moves then.
        """
        target = self._robot(robot)
        angles, speeds = check_command(robot, wheel_angles_rad, speed_limits_rad_s, self.parameters.motor)
        if target.held:
            raise WorldError(f"robot '{robot}' has left the plate and stays where it is; reset the world")
        lockstep = self.parameters.lockstep
        if robot not in lockstep or (target.moving and not target.disturbed):
            target.begin(angles, speeds)
            return
        self._pending[robot] = (angles, speeds)
        if all(name in self._pending for name in lockstep):
            for name in lockstep:
                self._robots[name].begin(*self._pending.pop(name))

    def push(self, push: Push) -> None:
        """Displace a robot at once: whatever it does goes on from there, its wheels and encoders don't notice.

        Raises:
            WorldError: on an unknown robot, one that has left the plate or would leave it, or one that would stand in
                another. Nothing moves then.
        """
        robot = self._robot(push.robot)
        before = robot.body.pose()
        after = displaced(before, self.surface, push, self.parameters.wheels)
        if robot.held or off_plate(self.surface, after, self.parameters.marker.top_m) is not None:
            raise WorldError(f"robot '{robot.name}' can't be pushed beyond the plate's edge")
        robot.body.shift(after)
        if self._touched(robot):
            robot.body.shift(before)
            raise WorldError(f"robot '{robot.name}' can't be pushed: it would stand in another robot")

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

    def owe_time(self, until_ns: int) -> None:
        """Let time go on at least until the first frame at or after a time since the start, nanoseconds."""
        steps = -(-until_ns * self.parameters.physics_hz // 10**9)
        self._owed_until = max(self._owed_until, steps + -steps % self._frame_steps)

    def frames_owed(self, robot: str) -> int:
        """How many requested frames of a robot's camera are outstanding."""
        return self._frames_owed.get(robot, 0)

    def advance(self) -> list[Event]:
        """Go on to the next instant at which something is published, and return it; empty if nothing is owed."""
        while self._owes():
            events = self._step()
            if events or self.step_count == self._owed_until:
                return events
        return []

    def step(self) -> list[Event]:
        """Go on by one physics step if anything is owed, and return what is published then.

        Any mixture of `step` and `advance` gives the same events.
        """
        return self._step(skip=False) if self.owes else []

    def close(self) -> None:
        """Free the physics engine; the world can't be used afterwards."""
        self._free()

    # --- time -------------------------------------------------------------------------------------------------------

    def _step(self, skip: bool = True) -> list[Event]:
        """Make one step and return what is due then; with `skip` go straight to the next frame if all robots sleep."""
        if not self._step_physics():
            self.step_count += 1
            if skip and not any(robot.moving for robot in self._robots.values()):
                # Only the clock runs.
                self.step_count += -self.step_count % self._frame_steps
        events = self._motion_events()
        if self.step_count % self._frame_steps == 0:
            events += self._frames()
        return events

    def _step_physics(self) -> bool:
        """Make one step if any robot is awake."""
        sleepers = []
        for robot in self._robots.values():
            if robot.awake:
                robot.body.apply_ground_forces()
            else:
                sleepers.append(robot)
        if len(sleepers) == len(self._robots):
            return False
        pybullet.stepSimulation(self._client)
        self.step_count += 1
        # Nothing but another body moves a sleeper. Asking for contacts costs as much as asking one robot.
        if len(sleepers) == 1 or (sleepers and _read_contacts(physicsClientId=self._client)):
            for robot in sleepers:
                if robot.pushed():
                    robot.disturb()
        return True

    def _motion_events(self) -> list[Event]:
        events: list[Event] = []
        due = self.step_count % self._state_steps == 0
        for name, robot in self._robots.items():
            if not robot.moving:
                continue
            final = robot.finished()
            if not (final or due):
                continue
            stamp = self.stamp_ns
            state = robot.body.state()
            left = off_plate(self.surface, state.pose, self.parameters.marker.top_m)
            if left is not None:
                robot.hold()
                state = robot.body.state()
                final = True
            joints = robot.joint_states(stamp, final=final)
            if final or any(joints.velocities):
                events.append(joints)
            events.append(RobotPose(name, stamp, state, final))
            if left is not None:
                events.append(LeftPlate(name, stamp, *left))
        return events

    def _frames(self) -> list[Event]:
        stream = self.parameters.camera.mode is CameraMode.STREAM
        frames: list[Event] = []
        for name, owed in self._frames_owed.items():
            if owed or stream:
                frames.append(Frame(name, self.stamp_ns, self._take_picture(name)))
                self._frames_owed[name] = max(0, owed - 1)
        return frames

    def _take_picture(self, name: str) -> RenderedPicture:
        sensor = self._sensors[name]
        everyone = [robot.body.pose() for robot in self._robots.values()]
        kept = self._pictures.get(name)
        if kept is None or kept.everyone != everyone:
            own = self._robots[name].body.pose()
            others = [pose for other, pose in zip(self._robots, everyone, strict=True) if other != name]
            seen = [own, *self._camera.may_see(own, others)]
            if kept is None or kept.seen != seen:
                development = sensor.develop(self._camera.light_of(own, seen[1:]))
            else:
                development = kept.development
            kept = self._pictures[name] = _Picture(everyone, seen, development)
        return sensor.expose(kept.development, self.step_count / self.parameters.physics_hz)

    def _owes(self) -> bool:
        for robot in self._robots.values():
            if robot.moving:
                return True
        return any(self._frames_owed.values()) or self.step_count < self._owed_until

    # --- checks -----------------------------------------------------------------------------------------------------

    def _robot(self, name: str) -> Robot:
        robot = self._robots.get(name)
        if robot is None:
            raise WorldError(f"no robot '{name}'{suggestion(name, self._robots)}")
        return robot

    def _touched(self, robot: Robot) -> bool:
        """Whether a robot's body touches another one's."""
        return any(
            pybullet.getClosestPoints(robot.body.index, other.body.index, 0.0, physicsClientId=self._client)
            for other in self._robots.values()
            if other is not robot
        )

    def _check_overlap(self) -> None:
        robots = list(self._robots.values())
        for i, a in enumerate(robots):
            for b in robots[i + 1 :]:
                if pybullet.getClosestPoints(a.body.index, b.body.index, 0.0, physicsClientId=self._client):
                    self.close()
                    raise WorldError(f"robots '{a.name}' and '{b.name}' overlap at their starts; move them apart")
