"""Fine-tuner: moves by the prediction, looks, corrects and reports the timestep."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from robot_formation import conversions, exit_codes, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.node_parameters import FineTunerNodeParameters
from robot_formation.follower import fine_tuning as core
from robot_formation.follower.alignment_state import State
from robot_formation.follower.camera_calibration_file import calibrated
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import EXACT, UncertainMotion
from robot_formation.names import Message


class FineTunerComponent(Component):
    """Hosts the follower's state machine."""

    def __init__(self, parameters: FineTunerNodeParameters, place: Place) -> None:
        super().__init__(place)
        self._tuner = core.FineTuner(calibrated(parameters))
        self.patience_s = parameters.look.patience_s
        self._neighbour = names.formation_done(names.beacon_neighbour(place.robot), place.formation)
        listeners = ("leader", "fine_tuner")[: parameters.done_listeners]
        self._done = names.formation_done(place.robot, place.formation, listeners=listeners)
        self._base = place.frame(names.BASE_FRAME)
        self._answers: dict[int, dict[names.Topic, Message]] = {}  # the predictor's, by stamp
        self._first_forecast_ns: int | None = None

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [
            Input(self._neighbour, self._on_neighbour_done),
            Input(names.PREDICTION, partial(self._on_answer, names.PREDICTION)),
            Input(names.FORECAST, partial(self._on_answer, names.FORECAST)),
            Input(names.BLOCKS, self._on_blocks),
            Input(names.MOVED, self._on_moved),
        ]

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        return [
            names.MOVE,
            names.camera_request(),
            names.COMMANDED,
            names.DISPLACEMENT,
            names.RESIDUAL,
            names.ALIGNMENT,
            self._done,
        ]

    def stalled(self) -> None:
        """See `Component`: frames that don't come are asked for again, up to a bound."""
        self._act(self._tuner.stalled())

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {"timestep": str(self._tuner.timestep), "waiting for": self._tuner.phase.name.lower()}

    def _on_neighbour_done(self, message: Message) -> None:
        self._act(self._tuner.neighbour_done(int(message.data)))

    def _on_answer(self, topic: names.Topic, message: Message) -> None:
        """Take the predictor's answer once both of its messages are here, in whatever order they came.

        `forecast` is waited for only after it has been heard of in an earlier timestep: a predictor that sends
        none works too, and what is heard doesn't depend on the order in which topics arrive.
        """
        stamp_ns = conversions.stamp_of(message)
        if topic == names.FORECAST and self._first_forecast_ns is None:
            self._first_forecast_ns = stamp_ns
        self._answers.setdefault(stamp_ns, {})[topic] = message
        parts = self._answers[stamp_ns]
        expected = self._first_forecast_ns is not None and self._first_forecast_ns < stamp_ns
        if names.PREDICTION not in parts or (expected and names.FORECAST not in parts):
            return
        self._answers = {stamp: found for stamp, found in self._answers.items() if stamp > stamp_ns}
        prediction, forecast = parts[names.PREDICTION], parts[names.FORECAST] if expected else None
        mean = conversions.read_displacement(prediction) if conversions.has_estimate(prediction) else None
        step = None
        if forecast is not None and conversions.has_estimate(forecast):
            step = UncertainMotion(conversions.read_displacement(forecast), conversions.read_covariance(forecast))
        self._act(self._tuner.prediction(mean, step))

    def _on_moved(self, message: Message) -> None:
        self._act(self._tuner.moved(conversions.read_displacement(message), conversions.stamp_of(message)))

    def _on_blocks(self, message: Message) -> None:
        try:
            blocks = conversions.read_blocks(message)
        except conversions.MessageError as error:
            self.warn(str(error))
            return
        self._act(self._tuner.frame(blocks, conversions.stamp_of(message)))

    def _act(self, actions: Sequence[core.Action]) -> None:
        self.stamp_ns = self._tuner.stamp_ns
        for action in actions:
            match action:
                case core.SendMove(motion):
                    self._send(names.MOVE, conversions.move(motion, self._base, self.stamp_ns))
                case core.RequestFrames(count):
                    self._send(names.camera_request(), conversions.uint32(count))
                case core.Report():
                    self._report(action)
                case core.Done(timestep):
                    self._send(self._done, conversions.uint32(timestep))
                case State():
                    self._send(names.ALIGNMENT, conversions.string(action.text))
                case core.Warn(text):
                    self.warn(text)
                case core.Lost():
                    self.finish(
                        exit_codes.LOST,
                        f"{self.place.robot} lost its beacon neighbour in timestep {self._tuner.timestep}",
                    )

    def _report(self, report: core.Report) -> None:
        # The predictor waits for the pair, so what it may use beside them goes first.
        for topic, motion in (
            (names.COMMANDED, None if report.commanded is None else UncertainMotion(report.commanded)),
            (names.DISPLACEMENT, UncertainMotion(report.displacement, (*EXACT[:-1], report.caught_up_rad**2))),
            (names.RESIDUAL, report.residual),
        ):
            mean, covariance = (
                (Motion(), conversions.NO_ESTIMATE) if motion is None else (motion.mean, motion.covariance)
            )
            self._send(topic, conversions.displacement(mean, self._base, self.stamp_ns, covariance))
