"""Predictor: learns from the follower's own displacements how far it must move in the next timestep."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import covariance_xy
from robot_formation.koopman.predictors import PredictionError, Predictor, PredictorParameters
from robot_formation.koopman.predictors.models import Vector
from robot_formation.names import Message
from robot_formation.system.files import MOST_RECORD_BYTES, read_file

_MOST_UNPAIRED = 16  # timesteps of which not all parts have come: in a run, one at a time


class _Part(NamedTuple):
    """A part of a timestep: (u, v, turn) [m, rad], None where there is no estimate, and the turn's deviation [rad]."""

    motion: Vector | None
    turn_sigma_rad: float = 0.0


class PredictorComponent(Component):
    """Answers each pair of `displacement` and `residual` with a `prediction`."""

    def __init__(self, parameters: PredictorParameters, place: Place) -> None:
        super().__init__(place)
        state_file = parameters.state_file.replace("{robot}", place.robot)
        self._state_file = Path(state_file) if state_file else None
        self.predictor = self._restored(parameters)
        self._parts: dict[int, dict[names.Topic, _Part]] = {}  # by stamp, then topic
        self._first_commanded_ns: int | None = None

    def _restored(self, parameters: PredictorParameters) -> Predictor:
        """Begin anew, or where the state file says that an earlier one was."""
        if not parameters.load_state:
            return Predictor(parameters)
        if self._state_file is None:
            raise PredictionError("'load_state' needs the 'state_file' to load")
        if not self._state_file.exists():
            return Predictor(parameters)
        try:
            state = json.loads(read_file(self._state_file, MOST_RECORD_BYTES))
        except (OSError, ValueError, RecursionError) as error:
            raise PredictionError(f"{self._state_file}: can't read the predictor's state: {error}") from None
        try:
            return Predictor.from_state(parameters, state)
        except PredictionError as error:
            raise PredictionError(f"{self._state_file}: {error}") from None

    def _save(self) -> None:
        """Keep what was learned; a node that dies while writing leaves the last whole state."""
        if self._state_file is None:
            return
        unfinished = self._state_file.with_name(self._state_file.name + ".partial")
        try:
            unfinished.write_text(json.dumps(self.predictor.state()), encoding="utf-8")
            unfinished.replace(self._state_file)
        except OSError as error:
            self.warn(f"can't keep the predictor's state: {error}")

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [
            Input(topic, partial(self._on_part, topic))
            for topic in (names.COMMANDED, names.DISPLACEMENT, names.RESIDUAL)
        ]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.FORECAST, names.PREDICTION]

    def details(self) -> dict[str, str]:
        """See `Component`."""
        diagnostics = self.predictor.diagnostics()
        values = {"predictor": self.predictor.name, "timesteps": str(self.predictor.observations)}
        for name, array in (
            ("K", diagnostics.k),
            ("eigenvalues", diagnostics.eigenvalues),
            ("innovation [m]", diagnostics.innovation),
        ):
            if array is not None:
                values[name] = np.array2string(array, precision=6, separator=", ").replace("\n", "")
        if diagnostics.consistency is not None:
            values["consistency index"] = f"{diagnostics.consistency:.4g}"
        if diagnostics.qualities is not None:
            values["periods (residual, noise)"] = ", ".join(
                f"{found.period:.1f} ({found.residual:.2f}, {found.noise:.2f}{', spurious' * found.spurious})"
                for found in diagnostics.qualities
                if found.period is not None and found.eigenvalue.imag >= 0.0
            )
        values.update(diagnostics.notes or {})
        if diagnostics.condition_number is not None:
            values["condition number"] = f"{diagnostics.condition_number:.4g}"
        return values

    def actuation_bias(self) -> tuple[float, float]:
        """By how much (u, v) the robot is expected to go farther than told, metres; zero if that isn't learned."""
        if not self.predictor.observations:
            return (0.0, 0.0)
        forecast = self.predictor.predict()
        u_m, v_m, _ = (forecast.mean - forecast.command).tolist()
        return (u_m, v_m)

    def _on_part(self, topic: names.Topic, message: Message) -> None:
        stamp_ns = conversions.stamp_of(message)
        if topic == names.COMMANDED and self._first_commanded_ns is None:
            self._first_commanded_ns = stamp_ns
        self._parts.setdefault(stamp_ns, {})[topic] = self._read(topic, message)
        while len(self._parts) > _MOST_UNPAIRED:
            oldest_ns = next(iter(self._parts))
            there = " and ".join(found.name for found in self._parts.pop(oldest_ns))
            self.warn(f"{there} of {oldest_ns} ns came without the rest of the timestep and is forgotten")
        self._answer(stamp_ns)

    def _read(self, topic: names.Topic, message: Message) -> _Part:
        """Read a part; NaN stands for a turn not known."""
        if not conversions.has_estimate(message):
            if topic == names.DISPLACEMENT:
                self.warn("a displacement without an estimate is left out")
            return _Part(None)
        motion = conversions.read_displacement(message)
        if not motion.finite:
            self.warn(
                f"{topic.name}: ({motion.u_m}, {motion.v_m}) m, {motion.yaw_rad} rad is not finite; it is left out"
            )
            return _Part(None)
        unknown = topic == names.RESIDUAL and not conversions.knows_turn(message)
        *_, variance = conversions.read_covariance(message)
        sigma_rad = math.sqrt(variance) if 0.0 < variance <= math.pi**2 else 0.0
        return _Part(np.array([motion.u_m, motion.v_m, math.nan if unknown else motion.yaw_rad]), sigma_rad)

    def _answer(self, stamp_ns: int) -> None:
        """Predict once all parts of the timestep are here, in whatever order they came.

        `commanded` is waited for only after it has been heard of in an earlier timestep: whoever sends none gets
        answers too, and what is heard doesn't depend on the order in which topics arrive.
        """
        parts = self._parts.get(stamp_ns, {})
        if names.DISPLACEMENT not in parts or names.RESIDUAL not in parts:
            return
        expected = self._first_commanded_ns is not None and self._first_commanded_ns < stamp_ns
        if expected and names.COMMANDED not in parts:
            return
        self.stamp_ns = stamp_ns
        del self._parts[stamp_ns]
        displacement, caught_up_rad = parts[names.DISPLACEMENT]
        residual = parts[names.RESIDUAL].motion
        if displacement is not None:
            commanded = parts[names.COMMANDED].motion if expected else None
            try:
                self.predictor.observe(displacement, residual, commanded, caught_up_rad=caught_up_rad)
            except PredictionError as error:
                self.warn(str(error))
        try:
            forecast = self.predictor.predict()
        except PredictionError as error:
            self.warn(f"{error}; answering with no motion")
            for topic in (names.FORECAST, names.PREDICTION):  # the fine-tuner waits for both
                self._send_answer(topic, Motion(), conversions.NO_ESTIMATE)
            return
        self._save()  # before the answer: whoever has it finds the state that goes with it
        # The fine-tuner waits for the prediction, so what it may use beside it goes first.
        covariance = covariance_xy(forecast.covariance)
        self._send_answer(names.FORECAST, _motion(self.predictor.step(residual)), covariance)
        self._send_answer(names.PREDICTION, _motion(forecast.command), covariance_xy(forecast.about_command))

    def _send_answer(self, topic: names.Topic, mean: Motion, covariance: Sequence[float]) -> None:
        base = self.place.frame(names.BASE_FRAME)
        self._send(topic, conversions.displacement(mean, base, self.stamp_ns, covariance))


def _motion(found: Vector) -> Motion:
    u_m, v_m, turn_rad = found.tolist()
    return replace(Motion.from_uv(u_m, v_m), yaw_rad=turn_rad)
