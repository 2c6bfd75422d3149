"""The leader: one straight step, then wait for the formation; a state machine without input or output.

The leader drives with a constant wheel rotation per timestep (paper, "Experimental setups"); it starts the next
timestep on the followers' bare ready ticks, which carry no pose and no velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import parameter


@dataclass(frozen=True)
class LeaderParameters:
    """What the leader does."""

    timesteps: int = parameter(20, "Number of timesteps to drive", low=1, high=100000)
    step_m: float = parameter(
        0.05, "Forward displacement asked of the drive per timestep", unit="m", low=0.001, high=0.2
    )
    followers: tuple[str, ...] = parameter(("follower_1",), "Robots whose done ticks are waited for")


@dataclass(frozen=True)
class LeaderAction:
    """What to send now: a move, a done tick, or the end of the tour. Absent parts are None/False."""

    move: Motion | None = None
    done: int | None = None
    finished: bool = False


NOTHING = LeaderAction()


class Leader:
    """Counts timesteps: waits for every follower's tick t-1, moves, ticks t, until the tour ends.

    With `paused` set no new timestep begins; `resume` goes on where it stopped.
    """

    def __init__(self, parameters: LeaderParameters) -> None:
        self._parameters = parameters
        self._ready: dict[str, int] = dict.fromkeys(parameters.followers, -1)
        self._moving = False
        self.timestep = 0
        self.paused = False
        self.finished = False

    @property
    def waiting_for(self) -> Sequence[str]:
        """The followers whose tick for the present timestep is missing."""
        return [name for name, tick in self._ready.items() if tick < self.timestep]

    def start(self) -> LeaderAction:
        """Begin timestep 0: the leader stands, the followers may align."""
        return LeaderAction(done=0)

    def follower_done(self, follower: str, timestep: int) -> LeaderAction:
        """Process a follower's tick; the last missing one starts the next timestep or ends the tour."""
        if follower not in self._ready or timestep != self._ready[follower] + 1:
            return NOTHING
        self._ready[follower] = timestep
        return self._next()

    def moved(self) -> LeaderAction:
        """The drive has finished the step: tick the timestep."""
        if not self._moving:
            return NOTHING
        self._moving = False
        return LeaderAction(done=self.timestep)

    def resume(self) -> LeaderAction:
        """Go on after `paused`."""
        self.paused = False
        return self._next()

    def _next(self) -> LeaderAction:
        if self._moving or self.paused or self.finished or self.waiting_for:
            return NOTHING
        if self.timestep == self._parameters.timesteps:
            self.finished = True
            return LeaderAction(finished=True)
        self.timestep += 1
        self._moving = True
        return LeaderAction(move=Motion(x_m=self._parameters.step_m))
