"""Fine-tuner: moves by the prediction, looks, corrects and reports the timestep."""

from __future__ import annotations

from collections.abc import Sequence

from robot_formation import conversions, exit_codes, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.node_parameters import FineTunerNodeParameters
from robot_formation.follower import fine_tuning as core
from robot_formation.follower.alignment_state import State
from robot_formation.follower.camera_calibration_file import calibrated
from robot_formation.geometry.se2 import Motion
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

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [
            Input(self._neighbour, self._on_neighbour_done),
            Input(names.PREDICTION, self._on_prediction),
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

    def _on_prediction(self, message: Message) -> None:
        known = conversions.has_estimate(message)
        self._act(self._tuner.prediction(conversions.read_displacement(message) if known else None))

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
            (names.COMMANDED, report.commanded),
            (names.DISPLACEMENT, report.displacement),
            (names.RESIDUAL, report.residual),
        ):
            covariance = conversions.NO_ESTIMATE if motion is None else (0.0,) * 4
            self._send(topic, conversions.displacement(motion or Motion(), self._base, self.stamp_ns, covariance))
