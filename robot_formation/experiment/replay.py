"""Recorded displacements and pictures once more through today's predictor and detector, without a graph."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from robot_formation import conversions, names
from robot_formation.experiment.recorded_run import Recording, equal, handlers, host
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import JsonObject
from robot_formation.names import Message
from robot_formation.vision.pixy2.block import Block


@dataclass(frozen=True)
class PredictionRow:
    """A timestep's forecasts, made at the end of the one before, and the move that would have been right.

    Attributes:
        timestep: its number.
        recorded: forecast in the bag; None without one.
        today: forecast of today's predictor; None without one.
        ideal: displacement and residual of the timestep together; None where the camera had no estimate.
    """

    timestep: int
    recorded: Motion | None
    today: Motion | None
    ideal: Motion | None


@dataclass(frozen=True)
class PredictionReplay:
    """A follower's predictions, recorded and today's.

    Attributes:
        robot: the follower.
        rows: its timesteps.
        identical: every message has the same values, covariances too.
        sent: the messages that today's predictor sent.
    """

    robot: str
    rows: tuple[PredictionRow, ...]
    identical: bool
    sent: tuple[Message, ...]

    @property
    def changed(self) -> int:
        """Timesteps with another forecast."""
        return sum(row.recorded != row.today for row in self.rows)

    def rmse_m(self, which: str) -> float | None:
        """Root mean square distance in metres of the forecasts `recorded` or `today` from the ideal move."""
        pairs = [(getattr(row, which), row.ideal) for row in self.rows]
        squares = [(made.u_m - ideal.u_m) ** 2 + (made.v_m - ideal.v_m) ** 2 for made, ideal in pairs if made and ideal]
        return math.sqrt(sum(squares) / len(squares)) if squares else None


def replay_predictor(recording: Recording, changes: JsonObject) -> list[PredictionReplay]:
    """Show every follower's displacements, residuals and commanded distances to today's predictor.

    It begins knowing nothing and keeps no state, whatever the recorded one did, unless `changes` name a state file.

    Args:
        recording: the run.
        changes: parameters of the predictor that are to be others than recorded, by name.

    Raises:
        BagError: the bag lacks a topic that is needed.
        ParameterError: a change can't be.
    """
    parameters = recording.parameters("predictor", changes)
    if "state_file" not in changes:
        if parameters.load_state and "load_state" not in changes:
            recording.notes.append("the recorded predictor went on from its state file: the replay begins without it")
        parameters = replace(parameters, state_file="", load_state=changes.get("load_state", False))
    return [_replay_predictor(recording, robot, parameters) for robot in recording.followers]


def _replay_predictor(recording: Recording, robot: str, parameters: Any) -> PredictionReplay:
    displacements = list(recording.messages(robot, names.DISPLACEMENT))
    residuals = list(recording.messages(robot, names.RESIDUAL))
    commanded = _by_stamp(recording.any_messages(robot, names.COMMANDED))
    recorded = recording.any_messages(robot, names.PREDICTION)
    component, sent = host("predictor", parameters, robot, recording.notes)
    take = handlers(component)
    for displacement, residual in zip(displacements, residuals, strict=False):
        command = commanded.get(conversions.stamp_of(displacement))
        if command is not None:
            take[names.COMMANDED.name](command)
        take[names.DISPLACEMENT.name](displacement)
        take[names.RESIDUAL.name](residual)
    today = [message for topic, message in sent if topic == names.PREDICTION.name]
    before, after = _by_stamp(recorded), _by_stamp(today)
    rows = []
    for number, displacement in enumerate(displacements):
        stamp_ns = conversions.stamp_of(displacements[number - 1]) if number else -1
        residual = residuals[number] if number < len(residuals) else None
        ideal = _ideal(displacement, residual)
        rows.append(PredictionRow(number + 1, _estimate(before.get(stamp_ns)), _estimate(after.get(stamp_ns)), ideal))
    return PredictionReplay(robot, tuple(rows), equal(recorded, today), tuple(today))


def _by_stamp(messages: list[Message]) -> dict[int, Message]:
    return {conversions.stamp_of(message): message for message in messages}


def _estimate(message: Message) -> Motion | None:
    """Read a motion; None if there is no estimate."""
    if message is None or not conversions.has_estimate(message):
        return None
    return conversions.read_displacement(message)


def _ideal(displacement: Message, residual: Message) -> Motion | None:
    left = _estimate(residual)
    if left is None:
        return None
    return conversions.read_displacement(displacement).then(left)


@dataclass(frozen=True)
class FrameRow:
    """A picture's blocks; `recorded` is None where the bag has none for it."""

    stamp_ns: int
    recorded: tuple[Block, ...] | None
    today: tuple[Block, ...] | None

    @property
    def changed(self) -> bool:
        """Whether the blocks are others than they were."""
        return self.recorded is not None and self.recorded != self.today


@dataclass(frozen=True)
class DetectionReplay:
    """A follower's pictures, looked at again. `identical`: every message has the same values."""

    robot: str
    rows: tuple[FrameRow, ...]
    identical: bool

    @property
    def changed(self) -> int:
        """Pictures with other blocks."""
        return sum(row.changed for row in self.rows)


def replay_detector(recording: Recording, changes: JsonObject) -> list[DetectionReplay]:
    """Show every follower's pictures to today's detector; arguments and errors as for `replay_predictor`."""
    parameters = recording.parameters("block_detector", changes)
    return [_replay_detector(recording, robot, parameters) for robot in recording.followers]


def _replay_detector(recording: Recording, robot: str, parameters: Any) -> DetectionReplay:
    recorded = recording.any_messages(robot, names.BLOCKS)
    component, sent = host("block_detector", parameters, robot, recording.notes)
    take = handlers(component)[names.camera_image().name]
    stamps = []
    for image in recording.messages(robot, names.camera_image()):
        take(image)
        stamps.append(conversions.stamp_of(image))
    today = [message for _, message in sent]
    before, after = dict(_blocks(recorded)), dict(_blocks(today))
    rows = tuple(FrameRow(stamp_ns, before.get(stamp_ns), after.get(stamp_ns)) for stamp_ns in stamps)
    return DetectionReplay(robot, rows, equal(recorded, today))


def _blocks(messages: list[Message]) -> Iterator[tuple[int, tuple[Block, ...]]]:
    for message in messages:
        yield conversions.stamp_of(message), tuple(conversions.read_blocks(message))
