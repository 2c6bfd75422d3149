"""Recorded blocks once more through today's fine-tuner, timestep by timestep.

The fine-tuner is a state machine that waits for one thing at a time: it is given the recorded message of that kind.
Where it decides otherwise than it did, the recorded run goes on all the same: a move is answered by the displacement
that followed the recorded one, and looks show what the camera saw then. So every look is judged again, and no
decision's consequences are guessed. A fine-tuner that wants more moves than were recorded stands and sees the last look
again until it gives up; of this only the first move that was not recorded is told.
"""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from robot_formation import conversions, names
from robot_formation.bag.errors import BagError
from robot_formation.experiment.recorded_run import Recording, equal, handlers, host
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import JsonObject
from robot_formation.names import Message

_SENT = (names.ALIGNMENT, names.MOVE, names.DISPLACEMENT, names.RESIDUAL)


@dataclass(frozen=True)
class Decisions:
    """What a fine-tuner did in a timestep: its states in order, and the moves that went with some of them."""

    states: tuple[str, ...]
    moves: tuple[Motion, ...]

    @property
    def corrections(self) -> tuple[Motion, ...]:
        """The moves after the prediction move; all of them in timestep 0, which has none."""
        return self.moves if self.states[:1] == (AlignmentState.ALIGN.format(),) else self.moves[1:]

    def first(self, moves: int) -> Decisions:
        """Keep what was decided up to a number of moves."""
        states = [place for place, state in enumerate(self.states) if _moves(state)]
        end = states[moves - 1] + 1 if moves <= len(states) else len(self.states)
        return Decisions(self.states[:end], self.moves[:moves])

    @property
    def outcome(self) -> str:
        """How the timestep ended: aligned, unaligned or lost; the last state where it did not end."""
        return self.states[-1] if self.states else ""


@dataclass(frozen=True)
class TimestepRow:
    """A timestep's decisions, recorded and today's.

    `beyond`: today's wants a move more than was recorded. That move is its last one here, since nothing tells what the
    camera would have seen after it.
    """

    timestep: int
    recorded: Decisions
    today: Decisions
    beyond: bool

    @property
    def changed(self) -> bool:
        """Whether anything was decided otherwise."""
        return self.recorded != self.today


@dataclass(frozen=True)
class FineTunerReplay:
    """A follower's timesteps, decided again. `identical`: every message has the same values."""

    robot: str
    rows: tuple[TimestepRow, ...]
    identical: bool

    @property
    def changed(self) -> int:
        """Timesteps with other decisions."""
        return sum(row.changed for row in self.rows)


def replay_fine_tuner(recording: Recording, changes: JsonObject) -> list[FineTunerReplay]:
    """Show every follower's blocks to today's fine-tuner.

    Args:
        recording: the run.
        changes: parameters of the fine-tuner that are to be others than recorded, by name.

    Raises:
        BagError: the bag lacks a topic that is needed, or is of a schedule without the neighbours' done ticks.
        ParameterError: a change can't be.
    """
    parameters = recording.parameters("fine_tuner", changes)
    if parameters.schedule.at_once:
        raise BagError(
            f"a fine-tuner can't be replayed from a run by the schedule '{parameters.schedule}', whose "
            "followers wait for no neighbour's tick; replay runs by turns or wave"
        )
    found = []
    for robot in recording.followers:
        own = recording.own_parameters(robot)
        its = recording.parameters("fine_tuner", {**own, **changes}) if own else parameters
        found.append(_Driver(recording, robot, its).run())
    return found


@dataclass
class _Script:
    """What a fine-tuner is given in one timestep."""

    tick: Message
    moved: deque[Message]
    blocks: deque[Message]
    prediction: Message
    forecast: Message


class _Driver:
    """Gives a fine-tuner what it waits for."""

    def __init__(self, recording: Recording, robot: str, parameters: Any) -> None:
        self._robot = robot
        self._tick = names.formation_done(names.beacon_neighbour(robot)).name
        self._recorded = {topic.name: recording.any_messages(robot, topic) for topic in _SENT}
        self._timesteps = _split(self._recorded)
        self._scripts = _scripts(recording, robot, self._timesteps, self._recorded)
        self._notes = recording.notes
        self._component, self._sent = host("fine_tuner", parameters, robot, self._notes)
        self._take = handlers(self._component)
        self._look_frames = parameters.look.frames
        self._last_look: deque[Message] = deque(maxlen=self._look_frames)
        self._repeat: deque[Message] = deque()
        self._stamp_ns = 0
        self._beyond = False

    def run(self) -> FineTunerReplay:
        beyond = []
        for script in self._scripts:
            self._beyond = False
            notes = len(self._notes)
            self._take[self._tick](script.tick)
            while self._component.exit_code is None and self._waits_for != "neighbour" and self._feed(script):
                pass
            beyond.append(self._beyond)
            if self._beyond:
                del self._notes[notes:]  # of what it did with a look that never was
            if self._component.exit_code is not None:
                break
        today: dict[str, list[Message]] = {topic.name: [] for topic in _SENT}
        for name, message in self._sent:
            today.setdefault(name, []).append(message)
        decided = _split(today)
        rows = []
        for number, (was, more) in enumerate(zip(self._timesteps, beyond, strict=False)):
            now = decided[number] if number < len(decided) else Decisions((), ())
            rows.append(TimestepRow(number, was, now.first(len(was.moves) + 1) if more else now, more))
        same = all(equal(self._recorded[topic.name], today[topic.name]) for topic in _SENT)
        return FineTunerReplay(self._robot, tuple(rows), same)

    @property
    def _waits_for(self) -> str:
        return self._component.details()["waiting for"]

    def _feed(self, script: _Script) -> bool:
        """Process one message; return whether there was one."""
        waits_for = self._waits_for
        if waits_for == "move":
            self._repeat.clear()
            self._moved(script)
        elif waits_for == "look":
            return self._show(script)
        elif waits_for == "prediction" and script.prediction is not None:
            if script.forecast is not None:
                self._take[names.FORECAST.name](script.forecast)
            self._take[names.PREDICTION.name](script.prediction)
        else:
            return False
        return True

    def _moved(self, script: _Script) -> None:
        if script.moved:
            message = script.moved.popleft()
        else:
            self._beyond = True
            self._stamp_ns = max(self._stamp_ns, self._component.stamp_ns) + 1
            message = conversions.displacement(Motion(), f"{self._robot}/{names.BASE_FRAME}", self._stamp_ns)
        self._take[names.MOVED.name](message)

    def _show(self, script: _Script) -> bool:
        if script.blocks:
            message = script.blocks.popleft()
            self._last_look.append(message)
        elif self._last_look:
            if not self._repeat:
                self._repeat.extend(self._last_look)
            self._stamp_ns = max(self._stamp_ns, self._component.stamp_ns) + 1
            message = copy.copy(self._repeat.popleft())
            message.header = conversions.header(self._stamp_ns, message.header.frame_id)
        else:
            return False
        self._take[names.BLOCKS.name](message)
        return True


def _moves(state: str) -> bool:
    """Whether a move goes with a state."""
    parsed = AlignmentState.parse(state)
    return parsed is not None and parsed.sends_move


def _split(sent: dict[str, list[Message]]) -> list[Decisions]:
    """Split into timesteps: each begins with a state of its own, and moves go with the states that send one."""
    moves = deque(conversions.read_move(message) for message in sent[names.MOVE.name])
    found: list[tuple[list[str], list[Motion]]] = []
    for message in sent[names.ALIGNMENT.name]:
        state = message.data
        parsed = AlignmentState.parse(state)
        if (parsed is not None and parsed.begins) or not found:
            found.append(([], []))
        found[-1][0].append(state)
        if moves and _moves(state):
            found[-1][1].append(moves.popleft())
    return [Decisions(tuple(states), tuple(made)) for states, made in found]


def _scripts(
    recording: Recording, robot: str, timesteps: Sequence[Decisions], recorded: dict[str, list[Message]]
) -> list[_Script]:
    """Cut the recorded inputs into timesteps: displacements by the moves that they answer, blocks by their stamps."""
    ticks = list(recording.messages(robot, names.formation_done(names.beacon_neighbour(robot))))
    moved = deque(recording.messages(robot, names.MOVED))
    blocks = deque(recording.messages(robot, names.BLOCKS))
    predictions = deque(recording.any_messages(robot, names.PREDICTION))
    forecasts = {conversions.stamp_of(message): message for message in recording.any_messages(robot, names.FORECAST)}
    ends = [conversions.stamp_of(message) for message in recorded[names.DISPLACEMENT.name]]
    found = []
    for number, (decisions, tick) in enumerate(zip(timesteps, ticks, strict=False)):
        own_moved = deque(moved.popleft() for _ in range(min(len(decisions.moves), len(moved))))
        if number == 0:  # it reports nothing; what the camera sees until the first displacement counts for no other
            end_ns = conversions.stamp_of(moved[0]) if moved else None
        else:
            end_ns = ends[number - 1] if number <= len(ends) else None
        own_blocks: deque[Message] = deque()
        while blocks and (end_ns is None or conversions.stamp_of(blocks[0]) <= end_ns):
            own_blocks.append(blocks.popleft())
        prediction = predictions.popleft() if number and predictions else None
        forecast = None if prediction is None else forecasts.get(conversions.stamp_of(prediction))
        found.append(_Script(tick, own_moved, own_blocks, prediction, forecast))
    return found
