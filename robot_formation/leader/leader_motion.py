"""The leader: one step of its path, then wait for the formation; a state machine without input or output.

The paper's leader drives straight with a constant wheel rotation per timestep ("Experimental setups"); it starts the
next timestep on the followers' bare ready ticks, which carry no pose and no velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths import PATHS, Given, LeaderPath, Room, make_path
from robot_formation.parameters import ParameterError, parameter
from robot_formation.schedule.schedules import Schedule, begin_s, period_parameter


@dataclass(frozen=True)
class LeaderParameters:
    """What the leader does."""

    timesteps: int = parameter(20, "Number of timesteps to drive", low=1, high=100000)
    step_m: float = parameter(
        0.05,
        "Displacement asked of the drive per timestep, where the path's own step_m isn't set",
        unit="m",
        low=0.001,
        high=0.2,
    )
    path: str = parameter("straight", "Name of the path (see 'formation list paths')", known=tuple(PATHS))
    path_parameters: tuple[str, ...] = parameter((), "The path's own parameters, each as 'name=value'")
    seed: int = parameter(
        0, "Seed of the path: its phase where none is given, a random walk's steps", low=0, high=2**63 - 1
    )
    room_m: tuple[float, ...] = parameter(
        (),
        "How far a random walk may go from the start: ahead, back, left, right; empty: anywhere",
        unit="m",
        low=0.0,
        high=1000.0,
    )
    followers: tuple[str, ...] = parameter(("follower_1",), "Robots whose done ticks are waited for")
    schedule: Schedule = parameter(Schedule.TURNS, "Who waits for whom before a timestep begins")
    period_s: float = period_parameter()

    def __post_init__(self) -> None:
        """Check that the room has four sides."""
        if len(self.room_m) not in (0, 4):
            raise ParameterError("leader: 'room_m' needs four distances: ahead, back, left and right of the start")

    def make_path(self) -> LeaderPath:
        """Build the path that the parameters name.

        Raises:
            ParameterError: if there is none of this name, or its own parameters can't be used.
        """
        room = Room(*self.room_m) if self.room_m else Room()
        path = make_path(self.path, self.path_parameters, Given(self.step_m, self.seed, room))
        if path.timesteps is not None and path.timesteps < self.timesteps:
            raise ParameterError(
                f"path '{self.path}' has {path.timesteps} timesteps, fewer than leader.timesteps = {self.timesteps}; "
                f"set leader.timesteps={path.timesteps}"
            )
        return path


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

    Args:
        parameters: what the leader does.
        motion: of a timestep, instead of the path's; None while it isn't known, and the timestep doesn't begin.
    """

    def __init__(self, parameters: LeaderParameters, motion: Callable[[int], Motion | None] | None = None) -> None:
        self._parameters = parameters
        self.path = parameters.make_path()
        self._motion = motion or self.path.motion
        self._schedule = parameters.schedule
        # In wave and together only the neighbour's ticks are heard, with timer nobody's.
        heard = parameters.followers if self._schedule is Schedule.TURNS else parameters.followers[:1]
        self._ready: dict[str, int] = dict.fromkeys(() if self._schedule is Schedule.TIMER else heard, -1)
        self._now_ns = 0
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

    @property
    def heard(self) -> Sequence[str]:
        """The followers whose ticks are waited for."""
        return list(self._ready)

    def clock(self, now_ns: int) -> LeaderAction:
        """Process simulated time since the start: with `timer` it begins the timesteps."""
        self._now_ns = now_ns
        return self._next()

    def moved(self) -> LeaderAction:
        """The drive has finished the step: tick the timestep."""
        if not self._moving:
            return NOTHING
        self._moving = False
        return LeaderAction(done=self.timestep)

    def go(self) -> LeaderAction:
        """Begin the next timestep if all are ready for it and its motion is known now."""
        return self._next()

    def resume(self) -> LeaderAction:
        """Go on after `paused`."""
        self.paused = False
        return self._next()

    @property
    def _due(self) -> bool:
        """Whether the clock lets the next timestep begin."""
        if self._schedule is not Schedule.TIMER:
            return True
        begin = begin_s(self.timestep + 1, self._parameters.period_s)
        return self._now_ns >= round(1e9 * begin)

    def _next(self) -> LeaderAction:
        if self._moving or self.paused or self.finished or self.waiting_for or not self._due:
            return NOTHING
        if self.timestep == self._parameters.timesteps:
            if self._schedule is Schedule.WAVE and min(self._ready.values(), default=0) <= self.timestep:
                return NOTHING  # one tick more says that all robots behind have finished
            self.finished = True
            return LeaderAction(finished=True)
        motion = self._motion(self.timestep + 1)
        if motion is None:
            return NOTHING
        self.timestep += 1
        self._moving = True
        return LeaderAction(move=motion)
