"""Leader: drives its path step by step and waits for the formation's ticks."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.geometry.se2 import Motion
from robot_formation.leader.driven_steps import DrivenSteps, Velocity
from robot_formation.leader.leader_motion import Leader, LeaderAction, LeaderParameters
from robot_formation.leader.paths import Teleop, poses
from robot_formation.names import Message
from robot_formation.schedule.schedules import Schedule

MOST_PLANNED = 2000
"""Poses of a plan; of a longer one every second, third, ... is published."""


class LeaderComponent(Component):
    """Moves on `move`, ticks on `<formation>/leader/done`, shows its plan on `plan`; driven by `cmd_vel` if teleop."""

    def __init__(self, parameters: LeaderParameters, place: Place) -> None:
        super().__init__(place)
        path = parameters.make_path()
        self._driven = DrivenSteps(path) if isinstance(path, Teleop) else None
        self._leader = Leader(parameters, self._driven_motion if self._driven else None)
        self._schedule = parameters.schedule
        self._timesteps = parameters.timesteps
        listeners = {Schedule.WAVE: ("fine_tuner", "world"), Schedule.TOGETHER: ()}.get(self._schedule, ("fine_tuner",))
        self._done = names.formation_done(place.robot, place.formation, listeners=listeners)
        self._begun = names.formation_begun(place.robot, place.formation, listeners=("fine_tuner", "world"))

    def inputs(self) -> list[Input]:
        """See `Component`."""
        found = [Input(names.MOVED, self._on_moved)]
        found += [
            Input(names.formation_done(name, self.place.formation), partial(self._on_done, name))
            for name in self._leader.heard
        ]
        if self._schedule is Schedule.TIMER:
            found.append(Input(names.formation_clock(self.place.home), self._on_clock))
        if self._driven:
            found.append(Input(names.CMD_VEL, lambda message: self._on_velocity(message.twist)))
            found.append(Input(names.CMD_VEL_UNSTAMPED, self._on_velocity))
        return found

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        ticks = {Schedule.TIMER: [], Schedule.TOGETHER: [self._done, self._begun]}.get(self._schedule, [self._done])
        return [names.MOVE, *ticks, *([] if self._driven else [names.PLAN])]

    def services(self) -> dict[str, Callable[[], tuple[bool, str]]]:
        """See `Component`."""
        return {"start": self._on_start, "stop": self._on_stop}

    def start(self) -> None:
        """See `Component`."""
        if self._driven is None:
            self._publish_plan()
        self._act(self._leader.start())

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {
            "timestep": str(self._leader.timestep),
            "waiting for": ", ".join(self._leader.waiting_for),
            "path": self._leader.path.name,
        }

    def _publish_plan(self) -> None:
        """Show viewers the whole path, in the frame in which the leader stands at its start."""
        frame = self.place.frame(names.ODOM_FRAME)
        planned = poses(self._leader.path, self._timesteps)
        every = -(-len(planned) // MOST_PLANNED)
        # The last pose belongs to it, whichever are left out.
        shown = [*planned[:-1:every], planned[-1]]
        plan = [conversions.planar_path_pose(pose, frame, self.stamp_ns) for pose in shown]
        self._send(names.PLAN, conversions.path(plan, frame, self.stamp_ns))

    def _driven_motion(self, timestep: int) -> Motion | None:
        return None if self._driven is None else self._driven.motion(self._now_s())

    def _now_s(self) -> float:
        """Wall time: a person's, who drives while the simulated one stands still."""
        return (self.wall_clock or time.monotonic)()

    def _on_velocity(self, twist: Message) -> None:
        assert self._driven is not None  # nobody listens otherwise
        velocity = Velocity(*conversions.read_planar_twist(twist))
        if not self._driven.command(velocity, self._now_s()):
            self.warn("a velocity that is not finite is ignored")
        self._act(self._leader.go())

    def _on_moved(self, message: Message) -> None:
        self.stamp_ns = conversions.stamp_of(message)
        self._act(self._leader.moved())
        self._act(self._leader.go())  # ticks, or the clock, may have been ahead of it

    def _on_done(self, follower: str, message: Message) -> None:
        self._act(self._leader.follower_done(follower, int(message.data)))

    def _on_clock(self, message: Message) -> None:
        self._act(self._leader.clock(conversions.read_clock(message)))

    def _on_start(self) -> tuple[bool, str]:
        self._act(self._leader.resume())
        return True, f"going on with timestep {self._leader.timestep}"

    def _on_stop(self) -> tuple[bool, str]:
        self._leader.paused = True
        return True, f"no new timestep after {self._leader.timestep}; call leader/start to go on"

    def _act(self, action: LeaderAction) -> None:
        if self._schedule is Schedule.TOGETHER and (action.move is not None or action.done == 0):
            self._send(self._begun, conversions.uint32(self._leader.timestep))
        if action.move is not None:
            self._send(names.MOVE, conversions.move(action.move, self.place.frame(names.BASE_FRAME), self.stamp_ns))
        if action.done is not None and self._schedule is not Schedule.TIMER:
            self._send(self._done, conversions.uint32(action.done))
        if action.finished:
            self.finish(0, f"all {self._leader.timestep} timesteps driven")
