"""What a person sees while a run goes on: one line per timestep, from the run's own messages."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from robot_formation import conversions, names
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.names import Message

_SAME = 1e-6  # metres and radians


@dataclass
class _Heard:
    """What was heard of a robot: stamps [ns] with poses, finished moves and timesteps; and what was said.

    A topic keeps its order, so these lists are sorted by stamp; between topics there is no order.
    """

    poses: list[tuple[int, Motion]] = field(default_factory=list)
    moves: list[tuple[int, Motion]] = field(default_factory=list)
    timesteps: list[tuple[int, Motion]] = field(default_factory=list)
    told: int = 0
    begun: int = 0
    state: str = ""

    def moves_between(self, after_ns: int, until_ns: int) -> list[tuple[int, Motion]]:
        """List the moves that ended in (after, until]."""
        return self.moves[
            bisect_right(self.moves, after_ns, key=_stamp) : bisect_right(self.moves, until_ns, key=_stamp)
        ]

    def timestep_moves(self, timestep: int, leader_ns: int) -> list[Motion] | None:
        """List the moves of a finished timestep, counted from 1; None until all are there.

        The first timestep's are those after the leader's first move has ended; or, where robots move at the same time,
        the last ones that sum up to the displacement.
        """
        if len(self.timesteps) < timestep:
            return None
        if timestep > 1:
            return self._moves_after(timestep, self.timesteps[timestep - 2][0])
        ends = [leader_ns, *(end for end, _ in reversed(self.moves_between(-1, self.timesteps[0][0] - 1))), -1]
        return next((moves for end in ends if (moves := self._moves_after(1, end)) is not None), None)

    def _moves_after(self, timestep: int, after_ns: int) -> list[Motion] | None:
        until_ns, displacement = self.timesteps[timestep - 1]
        # The fine-tuner counts no move whose displacement the drive couldn't measure.
        moves = [move for _, move in self.moves_between(after_ns, until_ns) if move.finite]
        total = Motion()
        for move in moves:
            total = total.then(move)
        missing = (total.x_m - displacement.x_m, total.y_m - displacement.y_m, total.yaw_rad - displacement.yaw_rad)
        return moves if all(abs(part) < _SAME for part in missing) else None

    def resting_pose(self, until_ns: int) -> Motion | None:
        """Return the true pose after the last move until a stamp; None until it is there.

        A robot has a true pose at the very end of each move, so an earlier one is another place's.
        """
        move = bisect_right(self.moves, until_ns, key=_stamp)
        pose = bisect_right(self.poses, until_ns, key=_stamp)
        if pose == 0 or (move > 0 and self.poses[pose - 1][0] < self.moves[move - 1][0]):
            return None
        return self.poses[pose - 1][1]


def _stamp(entry: tuple[int, Motion]) -> int:
    return entry[0]


class Progress:
    """Follows the messages of a run. Feed it absolute topic names with their messages.

    Messages of different topics may come in any order, as they do over the middleware: a timestep is told once
    everything that belongs to it has arrived, which the stamps and the sum of its moves tell.
    """

    def __init__(
        self,
        followers: int,
        timesteps: int,
        say: Callable[[str], None],
        elapsed: Callable[[], float],
        formation_distance_m: float = FORMATION_DISTANCE_M,
        *,
        delayed: bool = False,
        tell: Callable[[str, int, float, float], None] | None = None,
    ) -> None:
        """Begin.

        Args:
            followers: their number.
            timesteps: of the run, for the lines.
            say: takes the lines.
            elapsed: seconds since the beginning, for the lines.
            formation_distance_m: the fine-tuners'.
            delayed: whether places are those of one timestep earlier.
            tell: takes what a line says: follower, timestep, correction distance and formation error in metres.
        """
        self._delayed = delayed
        self._tell_figures = tell
        self._timesteps = timesteps
        self._say = say
        self._elapsed = elapsed
        self._place = Motion(y_m=-formation_distance_m)  # in formation, in the neighbour's frame
        self._followers = [names.follower(n) for n in range(1, followers + 1)]
        self._heard = {robot: _Heard() for robot in (names.LEADER, *self._followers)}
        self._handlers: dict[str, Callable[[Message], None]] = {}
        for robot in self._heard:
            self._handlers[f"/{names.ground_truth_pose(robot).name}"] = partial(self._pose, robot)
            self._handlers[names.MOVED.of(robot)] = partial(self._moved, robot)
        for robot in self._followers:
            self._handlers[names.ALIGNMENT.of(robot)] = partial(self._alignment, robot)
            self._handlers[names.DISPLACEMENT.of(robot)] = partial(self._displacement, robot)

    @property
    def topics(self) -> list[str]:
        """The topics that it wants to hear."""
        return list(self._handlers)

    @property
    def complete(self) -> bool:
        """Whether every timestep has been told."""
        return all(self._heard[robot].told >= self._timesteps for robot in self._followers)

    def listen(self, topic: str, message: Message) -> None:
        """Process a message; others than those of `topics` are ignored."""
        handler = self._handlers.get(topic)
        if handler is not None:
            handler(message)
            self._tell()

    def remind(self) -> None:
        """Print what happens between two timesteps, for a run in which one takes long."""
        for robot in self._followers:
            heard = self._heard[robot]
            doing = f" ({heard.state})" if heard.state else ""
            self._say(f"{robot} is in timestep {heard.begun}/{self._timesteps}{doing}  {self._elapsed():6.1f} s")

    def _pose(self, robot: str, message: Message) -> None:
        self._heard[robot].poses.append((conversions.stamp_of(message), conversions.read_pose(message.pose)))

    def _moved(self, robot: str, message: Message) -> None:
        self._heard[robot].moves.append((conversions.stamp_of(message), conversions.read_displacement(message)))

    def _displacement(self, robot: str, message: Message) -> None:
        self._heard[robot].timesteps.append((conversions.stamp_of(message), conversions.read_displacement(message)))

    def _alignment(self, robot: str, message: Message) -> None:
        state = AlignmentState.parse(message.data)
        heard = self._heard[robot]
        heard.state = message.data
        if state is None:
            return
        if state.opens_timestep:
            heard.begun += 1
        elif state is AlignmentState.LOST:
            self._say(f"{robot}: lost its beacon neighbour in timestep {heard.begun}")

    def _tell(self) -> None:
        for robot in self._followers:
            while self._tell_next(robot):
                pass

    def _tell_next(self, robot: str) -> bool:
        """Print the robot's next timestep if everything of it has arrived."""
        heard, leader = self._heard[robot], self._heard[names.LEADER]
        timestep = heard.told + 1
        if len(leader.moves) < timestep:
            return False
        begun_ns = leader.moves[0][0]
        moves = heard.timestep_moves(timestep, begun_ns)
        if moves is None:
            return False
        neighbour_name = names.beacon_neighbour(robot)
        neighbour = self._heard[neighbour_name]
        if neighbour_name != names.LEADER and neighbour.timestep_moves(timestep, begun_ns) is None:
            return False
        ended_ns = heard.timesteps[timestep - 1][0]
        own_pose = heard.resting_pose(ended_ns)
        place = neighbour.resting_pose(self._ended_ns(neighbour_name, timestep - 1) if self._delayed else ended_ns)
        if own_pose is None or place is None:
            return False
        heard.told = timestep
        self._say_line(robot, timestep, moves[1:], own_pose, place)  # without the prediction move
        return True

    def _ended_ns(self, robot: str, timestep: int) -> int:
        """Return when a robot finished a timestep, whose messages are here; 0 for the start."""
        heard = self._heard[robot]
        ends = heard.moves if robot == names.LEADER else heard.timesteps
        return ends[timestep - 1][0] if timestep else 0

    def _say_line(self, robot: str, timestep: int, corrections: list[Motion], own: Motion, neighbour: Motion) -> None:
        correction_m = sum(abs(move.x_m) + abs(move.y_m) for move in corrections)
        place = neighbour.then(self._place)
        error_m = math.hypot(own.x_m - place.x_m, own.y_m - place.y_m)
        if self._tell_figures is not None:
            self._tell_figures(robot, timestep, correction_m, error_m)
        who = f"{robot}  " if len(self._followers) > 1 else ""
        self._say(
            f"{who}timestep {timestep:2d}/{self._timesteps}  correction {correction_m * 100:5.1f} cm  "
            f"formation error {error_m * 100:5.2f} cm  {self._elapsed():6.1f} s"
        )
