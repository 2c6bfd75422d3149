"""What a person sees while a run goes on: one line per timestep, from the run's own messages."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from robot_formation import conversions, names
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import Slots
from robot_formation.names import Message

_SAME = 1e-6  # metres and radians
_FORGOTTEN_AT_ONCE = 1000


@dataclass
class _Entries:
    """Stamps [ns] with motions, in order; the oldest can be forgotten, and the others keep their numbers."""

    kept: list[tuple[int, Motion]] = field(default_factory=list)
    forgotten: int = 0

    def __len__(self) -> int:
        return self.forgotten + len(self.kept)

    def __getitem__(self, number: int) -> tuple[int, Motion]:
        return self.kept[number - self.forgotten]

    def add(self, stamp_ns: int, motion: Motion) -> None:
        """Append the next one."""
        self.kept.append((stamp_ns, motion))

    def between(self, after_ns: int, until_ns: int) -> list[tuple[int, Motion]]:
        """List those in (after, until]."""
        return self.kept[bisect_right(self.kept, after_ns, key=_stamp) : bisect_right(self.kept, until_ns, key=_stamp)]

    def last(self, until_ns: int) -> tuple[int, Motion] | None:
        """Return the last one until a stamp."""
        number = bisect_right(self.kept, until_ns, key=_stamp)
        return self.kept[number - 1] if number else None

    def forget(self, until_ns: int) -> None:
        """Forget those before the last one until a stamp, many at a time."""
        old = bisect_right(self.kept, until_ns, key=_stamp) - 1
        if old > _FORGOTTEN_AT_ONCE:
            del self.kept[:old]
            self.forgotten += old


@dataclass
class _Heard:
    """What was heard of a robot: poses, finished moves and timesteps; and what was said.

    A topic keeps its order, so these are sorted by stamp; between topics there is no order.
    """

    poses: _Entries = field(default_factory=_Entries)
    moves: _Entries = field(default_factory=_Entries)
    timesteps: _Entries = field(default_factory=_Entries)
    told: int = 0
    begun: int = 0
    state: str = ""

    def timestep_moves(self, timestep: int, leader_ns: int) -> list[Motion] | None:
        """List the moves of a finished timestep, counted from 1; None until all are there.

        The first timestep's are those after the leader's first move has ended; or, where robots move at the same time,
        the last ones that sum up to the displacement.
        """
        if len(self.timesteps) < timestep:
            return None
        if timestep > 1:
            return self._moves_after(timestep, self.timesteps[timestep - 2][0])
        ends = [leader_ns, *(end for end, _ in reversed(self.moves.between(-1, self.timesteps[0][0] - 1))), -1]
        return next((moves for end in ends if (moves := self._moves_after(1, end)) is not None), None)

    def _moves_after(self, timestep: int, after_ns: int) -> list[Motion] | None:
        until_ns, displacement = self.timesteps[timestep - 1]
        # The fine-tuner counts no move whose displacement the drive couldn't measure.
        moves = [move for _, move in self.moves.between(after_ns, until_ns) if move.finite]
        total = Motion()
        for move in moves:
            total = total.then(move)
        missing = (total.x_m - displacement.x_m, total.y_m - displacement.y_m, total.yaw_rad - displacement.yaw_rad)
        return moves if all(abs(part) < _SAME for part in missing) else None

    def resting_pose(self, until_ns: int) -> Motion | None:
        """Return the true pose after the last move until a stamp; None until it is there.

        A robot has a true pose at the very end of each move, so an earlier one is another place's.
        """
        move, pose = self.moves.last(until_ns), self.poses.last(until_ns)
        if pose is None or (move is not None and pose[0] < move[0]):
            return None
        return pose[1]

    def forget(self, until_ns: int) -> None:
        """Forget what was over before a stamp: a long run has very many moves."""
        for entries in (self.poses, self.moves, self.timesteps):
            entries.forget(until_ns)


def _stamp(entry: tuple[int, Motion]) -> int:
    return entry[0]


class Progress:
    """Follows the messages of a run. Feed it absolute topic names with their messages.

    Messages of different topics may come in any order, as they do over the middleware: a timestep is told once
    everything that belongs to it has arrived, which the stamps and the sum of its moves tell.
    """

    def __init__(
        self,
        slots: Slots,
        timesteps: int,
        say: Callable[[str], None],
        elapsed: Callable[[], float],
        *,
        delayed: bool = False,
        tell: Callable[[str, int, float, float], None] | None = None,
    ) -> None:
        """Begin.

        Args:
            slots: the followers' places, each in its neighbour's frame.
            timesteps: of the run, for the lines.
            say: takes the lines.
            elapsed: seconds since the beginning, for the lines.
            delayed: whether places are those of one timestep earlier.
            tell: takes what a line says: follower, timestep, correction distance and formation error in metres.
        """
        self._delayed = delayed
        self._tell_figures = tell
        self._timesteps = timesteps
        self._say = say
        self._elapsed = elapsed
        self._places = {names.follower(n): place for n, place in enumerate(slots, 1)}
        self._followers = list(self._places)
        self._begun_ns: int | None = None  # when the leader's first move ended
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
    def timestep_finished(self) -> bool:
        """Whether a follower has finished a timestep."""
        return any(len(self._heard[robot].timesteps) for robot in self._followers)

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
        self._heard[robot].poses.add(conversions.stamp_of(message), conversions.read_pose(message.pose))

    def _moved(self, robot: str, message: Message) -> None:
        self._heard[robot].moves.add(conversions.stamp_of(message), conversions.read_displacement(message))
        if robot == names.LEADER and self._begun_ns is None:
            self._begun_ns = conversions.stamp_of(message)

    def _displacement(self, robot: str, message: Message) -> None:
        self._heard[robot].timesteps.add(conversions.stamp_of(message), conversions.read_displacement(message))

    def _alignment(self, robot: str, message: Message) -> None:
        state = AlignmentState.parse(message.data)
        heard = self._heard[robot]
        heard.state = message.data
        if state is None:
            return
        if state.opens_timestep:
            heard.begun += 1
        elif state is AlignmentState.LOST:
            why = message.data.partition(": ")[2]
            self._say(
                f"{robot}: lost its beacon neighbour in timestep {heard.begun}{f' ({why})' if why else ''} and stands"
            )

    def _tell(self) -> None:
        for robot in self._followers:
            while self._tell_next(robot):
                pass

    def _tell_next(self, robot: str) -> bool:
        """Print the robot's next timestep if everything of it has arrived."""
        heard, leader = self._heard[robot], self._heard[names.LEADER]
        timestep = heard.told + 1
        if len(leader.moves) < timestep or self._begun_ns is None:
            return False
        moves = heard.timestep_moves(timestep, self._begun_ns)
        if moves is None:
            return False
        neighbour_name = names.beacon_neighbour(robot)
        neighbour = self._heard[neighbour_name]
        if neighbour_name != names.LEADER and neighbour.timestep_moves(timestep, self._begun_ns) is None:
            return False
        ended_ns = heard.timesteps[timestep - 1][0]
        own_pose = heard.resting_pose(ended_ns)
        place = neighbour.resting_pose(self._ended_ns(neighbour_name, timestep - 1) if self._delayed else ended_ns)
        if own_pose is None or place is None:
            return False
        heard.told = timestep
        self._forget()
        self._say_line(robot, timestep, moves[1:], own_pose, place)  # without the prediction move
        return True

    def _forget(self) -> None:
        """Forget what no line needs any more: a line to come is of a later timestep than those told of all followers.

        The moves of such a timestep begin where the one before it ended, and places may be those of one before that.
        """
        told = min(self._heard[robot].told for robot in self._followers)
        if told < 2:
            return
        until_ns = min(self._ended_ns(robot, told - 1) for robot in self._heard)
        for heard in self._heard.values():
            heard.forget(until_ns)

    def _ended_ns(self, robot: str, timestep: int) -> int:
        """Return when a robot finished a timestep, whose messages are here; 0 for the start."""
        heard = self._heard[robot]
        ends = heard.moves if robot == names.LEADER else heard.timesteps
        return ends[timestep - 1][0] if timestep else 0

    def _say_line(self, robot: str, timestep: int, corrections: list[Motion], own: Motion, neighbour: Motion) -> None:
        correction_m = sum(abs(move.x_m) + abs(move.y_m) for move in corrections)
        place = neighbour.then(self._places[robot])
        error_m = math.hypot(own.x_m - place.x_m, own.y_m - place.y_m)
        if self._tell_figures is not None:
            self._tell_figures(robot, timestep, correction_m, error_m)
        who = f"{robot}  " if len(self._followers) > 1 else ""
        self._say(
            f"{who}timestep {timestep:2d}/{self._timesteps}  correction {correction_m * 100:5.1f} cm  "
            f"formation error {error_m * 100:5.2f} cm  {self._elapsed():6.1f} s"
        )
