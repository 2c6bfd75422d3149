"""World: stands in for the robots and their cameras; the only source of simulated time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot_formation import conversions, exit_codes, names
from robot_formation.components.awaited_robots import AwaitedRobots
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.components.overhead_view import OverheadView
from robot_formation.components.trail import Trail
from robot_formation.errors import FormationError
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.names import Message
from robot_formation.schedule.schedules import Schedule
from robot_formation.surface import Surface
from robot_formation.world.description import robot_description
from robot_formation.world.events import Event, Frame, JointStates, LeftPlate, RobotPose
from robot_formation.world.picture_memory import keep_freed_memory
from robot_formation.world.pushes import Push
from robot_formation.world.world import World

_MESH_CELLS = 40
_CLOCK_PERIOD_NS = 100_000_000
"""Least time between two messages of `/clock` with `timer`, but for the ends of periods."""


class WorldComponent(Component):
    """Moves robots on `<robot>/joint_commands`, takes pictures on `<robot>/camera/request`, publishes what happens."""

    fixed: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("robots", "overhead.enabled", "schedule", "pushes"), "it decides on topics; start another world"
    )

    def __init__(self, parameters: WorldNodeParameters, place: Place) -> None:
        super().__init__(place)
        keep_freed_memory()
        self._set_up(parameters, 0)
        self._next = parameters
        self._paused = False
        self._told_ns = -_CLOCK_PERIOD_NS
        self.on_pose: Callable[[RobotPose], None] | None = None
        """Is told every pose as it is published: who is in the same process needs no message of it."""
        self._cameras = [start.name for start in parameters.starts() if start.camera]
        # Topics are made once: a run sends thousands of messages.
        waiting = ("leader", "fine_tuner") if parameters.schedule is Schedule.TIMER else ()
        self._clock = replace(names.CLOCK_TOPIC, listeners=waiting)
        self._joint_states = {name: names.joint_states(name) for name in parameters.robots}
        self._images = {name: names.camera_image(name) for name in self._cameras}
        self._truth = {
            name: (names.ground_truth_odom(name), names.ground_truth_pose(name), names.ground_truth_path(name))
            for name in parameters.robots
        }

    def _set_up(self, parameters: WorldNodeParameters, start_ns: int) -> None:
        """Make the world, or leave everything as it was if that is refused."""
        surface = parameters.make_surface()
        self._world = World(surface, parameters.starts(), parameters, seed=parameters.seed, start_ns=start_ns)
        self._surface = surface
        self._parameters = parameters
        self._moving: set[str] = set()
        self._numbers = dict.fromkeys(parameters.robots, "")  # of each robot's last command, echoed to its drive
        self._trails: dict[str, Trail[conversions.PathPose]] = {name: Trail() for name in parameters.robots}
        self._overhead = OverheadView(surface, parameters, parameters.seed)
        self.stamp_ns = start_ns
        self._awaited = AwaitedRobots(parameters.schedule, parameters.robots, parameters.timesteps, parameters.period_s)
        self._pushes = parameters.read_pushes()
        self._leader_moves = 0
        self._leader_between = False  # its motion has ended: the next leg of its move follows, or the move is over
        self._owe_period()

    def _owe_period(self) -> None:
        """With `timer`, let time go on to the beginning of the next timestep."""
        end_ns = self._awaited.period_end_ns
        if end_ns is not None:
            self._world.owe_time(end_ns)

    def inputs(self) -> list[Input]:
        """See `Component`."""
        commands = [
            Input(names.joint_commands(name), partial(self._on_command, name)) for name in self._parameters.robots
        ]
        requests = [Input(names.camera_request(name), partial(self._on_request, name)) for name in self._cameras]
        return [*commands, *requests, *self._ticks()]

    def _ticks(self) -> list[Input]:
        """Ticks by which it knows whom it has to wait for."""
        topic = {Schedule.WAVE: names.formation_done, Schedule.TOGETHER: names.formation_begun}.get(
            self._parameters.schedule
        )
        robots = self._parameters.robots
        heard = [Input(topic(name, self.place.formation), partial(self._on_tick, name)) for name in robots if topic]
        if self._parameters.schedule.at_once or self._parameters.pushes:
            heard.append(Input(names.moved(names.LEADER), self._on_leader_moved))
        if self._parameters.schedule is not Schedule.TURNS:
            heard += [Input(names.alignment(name), partial(self._on_alignment, name)) for name in self._cameras]
        return heard

    def _on_tick(self, robot: str, message: Message) -> None:
        timestep = int(message.data)
        if self._parameters.schedule is Schedule.WAVE:
            self._awaited.finished(robot, timestep)
        else:
            self._awaited.begun(robot, timestep)
        self._end_if_stuck()

    def _on_leader_moved(self, message: Message) -> None:
        self._leader_moves += 1
        self._leader_between = False
        for push in [push for push in self._pushes if push.timestep == self._leader_moves]:
            self._push(push)
        if self._parameters.schedule.at_once:
            self._awaited.idle(names.LEADER)
            self._end_if_stuck()

    def _push(self, push: Push) -> None:
        """Push a robot now; time stands still until then, since the leader's move has ended."""
        try:
            self._world.push(push)
        except FormationError as error:
            self.warn(f"{error}; the push of timestep {push.timestep} is left out")
            return
        state, rests = self._world.ground_truth(push.robot), push.robot not in self._moving
        self._publish(RobotPose(push.robot, self._world.stamp_ns, state, final=rests))

    def _on_alignment(self, robot: str, message: Message) -> None:
        if AlignmentState.parse(message.data) is AlignmentState.LOST:
            self._awaited.give_up(robot)
            self._end_if_stuck()

    def _end_if_stuck(self) -> None:
        """End the run if a robot is lost and all others wait for it, or for one that does."""
        if self._awaited.stuck and not self._world.owes:
            self.finish(exit_codes.LOST, "the others have finished what they could and stand")

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        topics = [self._clock, names.SURFACE, names.left_plate(), *self._overhead.topics()]
        for name in self._parameters.robots:
            topics += [self._joint_states[name], *self._truth[name], names.robot_description(name)]
        for name in self._cameras:
            topics += [self._images[name], names.camera_info(name)]
        return topics

    def start(self) -> None:
        """See `Component`: publishes what stands still, and every robot's start."""
        now = self.stamp_ns
        if self.wanted(names.SURFACE):
            vertices, colours, triangles = surface_mesh(self._surface)
            self._send(names.SURFACE, conversions.surface_marker(vertices, colours, triangles, names.WORLD_FRAME))
        camera = self._parameters.camera
        for name in self._cameras:
            info = conversions.camera_info(
                camera.width_px,
                camera.height_px,
                camera.focal_length_px,
                (camera.centre_x_px, camera.centre_y_px),
                f"{name}/{names.OPTICAL_FRAME}",
                now,
            )
            self._send(names.camera_info(name), info)
        for name in self._parameters.robots:
            text = robot_description(name, self._parameters, camera=name in self._cameras)
            self._send(names.robot_description(name), conversions.string(text))
        self._overhead.announce(self._send, now)
        self._tell_time()
        for name in self._parameters.robots:
            self._publish(RobotPose(name, now, self._world.ground_truth(name), final=True))
        self._overhead.look(self._world, self._send)

    @property
    def busy(self) -> bool:
        """See `Component`."""
        return self._world.owes and not self._paused and not self._waits and not self._over

    @property
    def _waits(self) -> bool:
        """Whether time stands still although it is owed: somebody has to order something or to say that it is done."""
        return self._awaited.any or self._leader_between

    @property
    def _over(self) -> bool:
        """Whether the leader now ends the run by the clock: a robot that is late doesn't finish its timestep."""
        by_clock = self._parameters.schedule is Schedule.TIMER and self._awaited.period_end_ns is None
        return by_clock and self._leader_moves >= self._parameters.timesteps

    def work(self) -> None:
        """See `Component`: advances to the next instant that has something to publish."""
        self._tell(self._world.advance())
        self._end_period()
        self._end_if_stuck()

    def _end_period(self) -> None:
        """With `timer`, begin the next timestep if it is time for it."""
        end_ns = self._awaited.period_end_ns
        if end_ns is not None and self._world.stamp_ns - self._world.start_ns >= end_ns:
            self._awaited.period_ended()
            self._owe_period()

    def _tell(self, events: list[Event]) -> None:
        self.stamp_ns = self._world.stamp_ns
        self._tell_time()
        for event in events:
            self._publish(event)
        self._overhead.after(events, self._world, self._send)

    def _tell_time(self) -> None:
        """Publish the time; with `timer` seldom, but at the end of each period, when robots may begin something.

        With `timer` every robot hears it, and each of many robots adds instants of its own.
        """
        end_ns = self._awaited.period_end_ns
        period_ends = end_ns is not None and self.stamp_ns - self._world.start_ns >= end_ns
        seldom = self._parameters.schedule is Schedule.TIMER and not period_ends
        if seldom and self.stamp_ns - self._told_ns < _CLOCK_PERIOD_NS:
            return
        self._told_ns = self.stamp_ns
        if self.wanted(self._clock):
            self._send(self._clock, conversions.clock(self.stamp_ns))

    def close(self) -> None:
        """See `Component`."""
        self._world.close()

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {
            "simulated time [s]": f"{self._world.stamp_ns / 1e9:.3f}",
            "owes": str(self._world.owes),
            names.PAUSED: str(self._paused),
            "waits for": ", ".join(self._awaited.names()),
        }

    def services(self) -> dict[str, Callable[[], tuple[bool, str]]]:
        """See `Component`."""
        return {"world/reset": self._on_reset, "world/step": self._on_step}

    def switches(self) -> dict[str, Callable[[bool], tuple[bool, str]]]:
        """See `Component`."""
        return {"world/pause": self._on_pause}

    def set_parameters(self, parameters: WorldNodeParameters) -> None:
        """See `Component`: keeps them for the next reset."""
        parameters.check()
        self._next = parameters

    def _on_reset(self) -> tuple[bool, str]:
        """Start again with the parameters set before; stamps go on at the next whole second."""
        if self._parameters.schedule is Schedule.TIMER:
            return False, "timesteps of the schedule timer are counted from the world's start: start the run again"
        old = self._world
        used = any(self._numbers.values()) or bool(self._moving)
        try:
            self._set_up(self._next, (old.stamp_ns // 10**9 + 1) * 10**9)
        except FormationError as error:
            return False, f"{error}; nothing was reset"
        old.close()
        self.start()
        for name in self._parameters.robots:
            self._publish(self._world.joint_states(name))
        text = f"seed {self._parameters.seed}, from {self.stamp_ns / 1e9:g} s on"
        if used:
            text += "; a run that was under way waits for ever: start its leader, fine-tuners and predictors again"
        return True, text

    def _on_pause(self, paused: bool) -> tuple[bool, str]:
        self._paused = paused
        return True, "paused" if paused else "running"

    def _on_step(self) -> tuple[bool, str]:
        """Make one physics step."""
        if not self._paused:
            return False, "the world runs: call world/pause with true first"
        if not self._world.owes:
            return False, "nothing is owed: time stands still until a command or a request comes"
        if self._waits:
            return False, f"{', '.join(self._awaited.names() or [names.LEADER])} have to order something first"
        self._tell(self._world.step())
        self._end_period()
        return True, f"{self.stamp_ns / 1e9:.6f} s"

    def _on_command(self, robot: str, message: Message) -> None:
        try:
            command = conversions.read_joint_command(message)
            self._world.command(robot, command.angles_rad, command.limits_rad_s)
        except ValueError as error:
            self.warn(f"{robot}: {error}; nothing moves")
            if robot in self._moving:
                return
            try:
                # A hold: who waits for the motion's end gets one.
                self._world.command(robot, (0.0,) * 4, (1.0,) * 4)
            except ValueError:
                return  # a robot that takes no commands at all any more
        self._numbers[robot] = message.header.frame_id
        self._moving.add(robot)
        if robot == names.LEADER:
            self._leader_between = False
        self._awaited.ordered(robot)

    def _on_request(self, robot: str, message: Message) -> None:
        count = int(message.data)
        if count == 0 and self._parameters.schedule is not Schedule.TURNS:
            self._awaited.idle(robot)
            self._end_if_stuck()
            return
        try:
            self._world.request_frames(robot, count)
        except ValueError as error:
            self.warn(f"{robot}: {error}")
            return
        self._awaited.ordered(robot, frames=True)

    def _publish(self, event: Event) -> None:
        match event:
            case JointStates():
                if event.final:
                    if self._pushes and event.robot == names.LEADER and event.robot in self._moving:
                        self._leader_between = True
                    self._moving.discard(event.robot)
                    self._awaited.rests(event.robot)
                if event.timed_out and event.final:
                    self.warn(f"{event.robot}: a motion took too long and was braked; is the robot blocked?")
                message = conversions.joint_states(
                    event.names, event.positions, event.velocities, event.stamp_ns, self._numbers[event.robot]
                )
                self._send(self._joint_states[event.robot], message)
            case Frame():
                frame = f"{event.robot}/{names.OPTICAL_FRAME}"
                self._send(self._images[event.robot], conversions.image(event.image, frame, event.stamp_ns))
                if not self._world.frames_owed(event.robot):
                    self._awaited.looked(event.robot)
            case RobotPose():
                self._publish_truth(event)
            case LeftPlate():
                self._send(names.left_plate(), conversions.string(event.robot))
                text = f"{event.robot} has left the plate at ({event.x_m:.2f}, {event.y_m:.2f}) m and is held there"
                self.warn(text)
                if self._parameters.leaving_ends_run:
                    self.finish(exit_codes.LOST, text)

    def _publish_truth(self, event: RobotPose) -> None:
        robot, state = event.robot, event.state
        if self.on_pose is not None:
            self.on_pose(event)
        if not any(self.wanted(topic) for topic in self._truth[robot]):
            return
        odom, pose_topic, path_topic = self._truth[robot]
        to_world = state.pose.matrix()
        place, orientation = state.pose.position, state.pose.orientation
        odometry = conversions.body_odometry(
            place,
            orientation,
            to_world.T @ np.array(state.linear_m_s),
            to_world.T @ np.array(state.angular_rad_s),
            frame=names.WORLD_FRAME,
            child=f"{robot}/{names.BASE_FRAME}",
            stamp_ns=event.stamp_ns,
        )
        self._send(odom, odometry)
        if event.final:
            self._send(pose_topic, conversions.pose(place, orientation, names.WORLD_FRAME, event.stamp_ns))
            pose = conversions.path_pose(place, names.WORLD_FRAME, event.stamp_ns, orientation)
            path = self._trails[robot].add(place, pose)
            if path is not None:
                self._send(path_topic, conversions.path(path, names.WORLD_FRAME, event.stamp_ns))


def surface_mesh(surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Triangulate the plate: vertices (n, 3) [m], colours (n, 3) by height, triangles (m, 3)."""
    ticks = np.linspace(0.0, surface.size_m, _MESH_CELLS + 1)
    xs, ys = np.meshgrid(ticks, ticks)
    zs = surface.heights(xs, ys)
    vertices = np.column_stack([xs.ravel(), ys.ravel(), zs.ravel()])
    spread = float(np.ptp(zs))
    shade = (zs.ravel() - zs.min()) / spread if spread > 0.0 else np.zeros(zs.size)
    colours = np.column_stack([0.25 + 0.45 * shade, 0.45 + 0.35 * shade, 0.35 + 0.2 * shade])
    corner = (np.arange(_MESH_CELLS)[:, None] * (_MESH_CELLS + 1) + np.arange(_MESH_CELLS)).ravel()
    right, up = corner + 1, corner + _MESH_CELLS + 1
    triangles = np.concatenate([np.column_stack([corner, right, up + 1]), np.column_stack([corner, up + 1, up])])
    return vertices, colours, triangles
