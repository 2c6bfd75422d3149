"""Leader: drives its track step by step and waits for the formation's ticks."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.leader.leader_motion import Leader, LeaderAction, LeaderParameters
from robot_formation.names import Message


class LeaderComponent(Component):
    """Moves on `move`, ticks on `<formation>/leader/done`."""

    def __init__(self, parameters: LeaderParameters, place: Place) -> None:
        super().__init__(place)
        self._leader = Leader(parameters)
        self._followers = parameters.followers
        self._done = names.formation_done(place.robot, place.formation)

    def inputs(self) -> list[Input]:
        """See `Component`."""
        ticks = [
            Input(names.formation_done(name, self.place.formation), partial(self._on_done, name))
            for name in self._followers
        ]
        return [Input(names.MOVED, self._on_moved), *ticks]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.MOVE, self._done]

    def services(self) -> dict[str, Callable[[], tuple[bool, str]]]:
        """See `Component`."""
        return {"start": self._on_start, "stop": self._on_stop}

    def start(self) -> None:
        """See `Component`."""
        self._act(self._leader.start())

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {"timestep": str(self._leader.timestep), "waiting for": ", ".join(self._leader.waiting_for)}

    def _on_moved(self, message: Message) -> None:
        self.stamp_ns = conversions.stamp_of(message)
        self._act(self._leader.moved())

    def _on_done(self, follower: str, message: Message) -> None:
        self._act(self._leader.follower_done(follower, int(message.data)))

    def _on_start(self) -> tuple[bool, str]:
        self._act(self._leader.resume())
        return True, f"going on with timestep {self._leader.timestep}"

    def _on_stop(self) -> tuple[bool, str]:
        self._leader.paused = True
        return True, f"no new timestep after {self._leader.timestep}; call leader/start to go on"

    def _act(self, action: LeaderAction) -> None:
        if action.move is not None:
            self._send(names.MOVE, conversions.move(action.move, self.place.frame(names.BASE_FRAME), self.stamp_ns))
        if action.done is not None:
            self._send(self._done, conversions.uint32(action.done))
        if action.finished:
            self.finish(0, f"all {self._leader.timestep} timesteps driven")
