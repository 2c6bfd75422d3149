"""Predictor: learns from the follower's own displacements how far it must move in the next timestep."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from robot_formation import conversions, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.geometry.se2 import Motion
from robot_formation.koopman.predictors import PredictionError, Predictor, PredictorParameters

# (u, v) to (x, y) = (v, -u): how a covariance of the paper's axes becomes one of REP-103.
_TO_XY = np.array([[0.0, 1.0], [-1.0, 0.0]])


class PredictorComponent(Component):
    """Answers each pair of `displacement` and `residual` with a `prediction`."""

    def __init__(self, parameters: PredictorParameters, place: Place) -> None:
        super().__init__(place)
        state_file = parameters.state_file.replace("{robot}", place.robot)
        self._state_file = Path(state_file) if state_file else None
        self._predictor = self._restored(parameters)
        self._displacements: dict[int, Any] = {}
        self._residuals: dict[int, Any] = {}
        self._commanded: dict[int, Any] = {}
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
            state = json.loads(self._state_file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
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
            unfinished.write_text(json.dumps(self._predictor.state()), encoding="utf-8")
            unfinished.replace(self._state_file)
        except OSError as error:
            self.warn(f"can't keep the predictor's state: {error}")

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [
            Input(names.COMMANDED, self._on_commanded),
            Input(names.DISPLACEMENT, self._on_displacement),
            Input(names.RESIDUAL, self._on_residual),
        ]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [names.PREDICTION]

    def details(self) -> dict[str, str]:
        """See `Component`."""
        diagnostics = self._predictor.diagnostics()
        values = {"predictor": self._predictor.name, "timesteps": str(self._predictor.observations)}
        for name, array in (
            ("K", diagnostics.k),
            ("eigenvalues", diagnostics.eigenvalues),
            ("innovation [m]", diagnostics.innovation),
        ):
            if array is not None:
                values[name] = np.array2string(array, precision=6, separator=", ").replace("\n", "")
        values.update(diagnostics.notes or {})
        if diagnostics.condition_number is not None:
            values["condition number"] = f"{diagnostics.condition_number:.4g}"
        return values

    def actuation_bias(self) -> tuple[float, float]:
        """By how much (u, v) the robot is expected to go farther than told, metres; zero if that isn't learned."""
        if not self._predictor.observations:
            return (0.0, 0.0)
        forecast = self._predictor.predict()
        u_m, v_m = (forecast.mean - forecast.command).tolist()
        return (u_m, v_m)

    def _on_displacement(self, message: Any) -> None:
        self._displacements[conversions.stamp_of(message)] = message
        self._answer(conversions.stamp_of(message))

    def _on_residual(self, message: Any) -> None:
        self._residuals[conversions.stamp_of(message)] = message
        self._answer(conversions.stamp_of(message))

    def _on_commanded(self, message: Any) -> None:
        stamp_ns = conversions.stamp_of(message)
        if self._first_commanded_ns is None:
            self._first_commanded_ns = stamp_ns
        self._commanded[stamp_ns] = message
        self._answer(stamp_ns)

    def _answer(self, stamp_ns: int) -> None:
        """Predict once all parts of the timestep are here, in whatever order they came.

        `commanded` is waited for only after it has been heard of in an earlier timestep: whoever sends none gets
        answers too, and what is heard doesn't depend on the order in which topics arrive.
        """
        if stamp_ns not in self._displacements or stamp_ns not in self._residuals:
            return
        expected = self._first_commanded_ns is not None and self._first_commanded_ns < stamp_ns
        if expected and stamp_ns not in self._commanded:
            return
        self.stamp_ns = stamp_ns
        displacement = _uv(self._displacements.pop(stamp_ns))
        residual = _uv(self._residuals.pop(stamp_ns))
        commanded = _uv(self._commanded.pop(stamp_ns)) if expected else None
        if displacement is None:
            self.warn("a displacement without an estimate is left out")
        else:
            try:
                self._predictor.observe(displacement, residual, commanded)
            except PredictionError as error:
                self.warn(str(error))
        try:
            forecast = self._predictor.predict()
        except PredictionError as error:
            self.warn(f"{error}; answering with no motion")
            self._send_prediction(Motion(), conversions.NO_ESTIMATE)
            return
        covariance = _TO_XY @ forecast.about_command @ _TO_XY.T
        self._save()  # before the answer: whoever has it finds the state that goes with it
        u_m, v_m = forecast.command.tolist()
        self._send_prediction(Motion.from_uv(u_m, v_m), covariance.ravel().tolist())

    def _send_prediction(self, mean: Motion, covariance: Any) -> None:
        base = self.place.frame(names.BASE_FRAME)
        self._send(names.PREDICTION, conversions.displacement(mean, base, self.stamp_ns, covariance))


def _uv(message: Any) -> Any:
    """Read (u, v) [m] of a displacement, None where there is no estimate."""
    if not conversions.has_estimate(message):
        return None
    motion = conversions.read_displacement(message)
    return np.array(motion.uv_m)
