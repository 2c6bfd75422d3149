"""Fine-tuner: moves by the prediction, looks, corrects and reports the timestep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from robot_formation import conversions, exit_codes, names
from robot_formation.components.base import Component, Input, Place
from robot_formation.components.node_parameters import FineTunerNodeParameters
from robot_formation.follower.actions import Action, Done, Lost, Report, RequestFrames, SendMove, Warn
from robot_formation.follower.alignment_state import State
from robot_formation.follower.camera_calibration_file import calibrated
from robot_formation.follower.fine_tuning import FineTuner, Phase
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import EXACT, UncertainMotion
from robot_formation.names import Message
from robot_formation.schedule.schedules import Schedule
from robot_formation.schedule.start_rule import StartRule


def done_listeners(schedule: Schedule, robots: int, *, first: bool) -> tuple[str, ...]:
    """Return the names of the nodes that have to hear a follower's tick.

    Args:
        schedule: who waits for whom.
        robots: 1 if no robot stands on the follower's right, else 2.
        first: whether the robot on its left is the leader.
    """
    if schedule is Schedule.TURNS:
        return ("leader", "fine_tuner")[:robots]
    if schedule is Schedule.TOGETHER:
        return ("leader" if first else "fine_tuner",)
    hearers = ["leader"] if first else ["fine_tuner"]
    return tuple(dict.fromkeys([*hearers, *["fine_tuner"][: robots - 1], "world"]))


class FineTunerComponent(Component):
    """Hosts the follower's state machine."""

    def __init__(self, parameters: FineTunerNodeParameters, place: Place) -> None:
        super().__init__(place)
        self._schedule = parameters.schedule
        self._last = parameters.done_listeners <= 1
        self._left = names.beacon_neighbour(place.robot)
        self._rule = StartRule(
            parameters.schedule,
            parameters.spacing,
            first=self._left == names.LEADER,
            last=self._last,
            period_s=parameters.period_s,
            timesteps=parameters.timesteps,
        )
        self._tuner = FineTuner(calibrated(parameters), self._rule)
        self.patience_s = parameters.look.patience_s
        self._timesteps = parameters.timesteps
        listeners = done_listeners(parameters.schedule, parameters.done_listeners, first=self._left == names.LEADER)
        self._done = names.formation_done(place.robot, place.formation, listeners=listeners)
        following = ("world",) if self._last else ("fine_tuner", "world")
        self._begun = names.formation_begun(place.robot, place.formation, listeners=following)
        self._told_begun = self._passed_on = -1
        self._finished = -1
        self._base = place.frame(names.BASE_FRAME)
        watching = () if self._schedule is Schedule.TURNS else ("world",)
        self._alignment = replace(names.ALIGNMENT, listeners=watching)
        self._answers: dict[int, dict[names.Topic, Message]] = {}  # the predictor's, by stamp
        self._first_forecast_ns: int | None = None

    def inputs(self) -> list[Input]:
        """See `Component`."""
        return [
            *self._ticks(),
            Input(names.PREDICTION, partial(self._on_answer, names.PREDICTION)),
            Input(names.FORECAST, partial(self._on_answer, names.FORECAST)),
            Input(names.BLOCKS, self._on_blocks),
            Input(names.MOVED, self._on_moved),
        ]

    def _ticks(self) -> list[Input]:
        """List what it hears of other robots, or of time: never more than bare ticks of its neighbours."""
        if self._schedule is Schedule.TIMER:
            return [Input(names.formation_clock(self.place.home), self._on_clock)]
        left = names.formation_begun if self._schedule is Schedule.TOGETHER else names.formation_done
        heard = [Input(left(self._left, self.place.formation), self._on_left)]
        if self._schedule is not Schedule.TURNS and not self._last:
            right = names.formation_done(names.right_neighbour(self.place.robot), self.place.formation)
            heard.append(Input(right, self._on_right))
        return heard

    def outputs(self) -> list[names.Topic]:
        """See `Component`."""
        ticks = {
            Schedule.TURNS: [self._done],
            Schedule.WAVE: [self._done],
            Schedule.TOGETHER: [self._done, self._begun],
            Schedule.TIMER: [],
        }[self._schedule]
        return [
            names.MOVE,
            names.camera_request(),
            names.COMMANDED,
            names.DISPLACEMENT,
            names.RESIDUAL,
            self._alignment,
            *ticks,
        ]

    def start(self) -> None:
        """See `Component`: by the clock the first alignment begins at once."""
        if self._schedule is Schedule.TIMER:
            self._act(self._tuner.heard())

    @property
    def _begins(self) -> int:
        """The latest timestep that has begun; 0 is the first alignment, -1: none."""
        return self._tuner.timestep - (self._tuner.phase is Phase.NEIGHBOUR)

    def stalled(self) -> None:
        """See `Component`: frames that don't come are asked for again, up to a bound."""
        self._act(self._tuner.stalled())

    def details(self) -> dict[str, str]:
        """See `Component`."""
        return {"timestep": str(self._tuner.timestep), "waiting for": self._tuner.phase.name.lower()}

    def _on_left(self, message: Message) -> None:
        self._act(self._tuner.neighbour_done(int(message.data)))

    def _on_right(self, message: Message) -> None:
        self._rule.right = max(self._rule.right, int(message.data))
        self._act(self._tuner.heard())
        self._pass_on()

    def _on_clock(self, message: Message) -> None:
        self._rule.now_ns = conversions.read_clock(message)
        self._act(self._tuner.heard())

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

    def _finish(self, timestep: int) -> None:
        """Tell that a timestep is finished, to whom it concerns."""
        self._finished = timestep
        if self._schedule in (Schedule.TURNS, Schedule.WAVE):
            self._send(self._done, conversions.uint32(timestep))
        else:
            self._send(names.camera_request(), conversions.uint32(0))  # the world need not wait any more
        self._pass_on()

    def _pass_on(self) -> None:
        """Pass on what all robots behind have finished.

        In `together` a timestep's tick waits for theirs. In `wave` the last timestep's is followed by one more then,
        which ends the tour.
        """
        behind = self._finished if self._last else min(self._finished, self._rule.right)
        if self._schedule is Schedule.WAVE:
            ended = self._finished == self._timesteps and (self._last or self._rule.right > self._timesteps)
            behind = self._timesteps + 1 if ended else -1
        if behind <= self._passed_on or self._schedule in (Schedule.TURNS, Schedule.TIMER):
            return
        self._passed_on = behind
        self._send(self._done, conversions.uint32(behind))

    def _act(self, actions: Sequence[Action]) -> None:
        self.stamp_ns = self._tuner.stamp_ns
        if self._schedule is Schedule.TOGETHER and self._begins > self._told_begun:
            self._told_begun = self._begins
            self._send(self._begun, conversions.uint32(self._begins))
        for action in actions:
            match action:
                case SendMove(motion):
                    self._send(names.MOVE, conversions.move(motion, self._base, self.stamp_ns))
                case RequestFrames(count):
                    self._send(names.camera_request(), conversions.uint32(count))
                case Report():
                    self._report(action)
                case Done(timestep):
                    self._finish(timestep)
                case State():
                    self._send(self._alignment, conversions.string(action.text))
                case Warn(text):
                    self.warn(text)
                case Lost(reason):
                    self._lose(reason)

    def _lose(self, reason: str) -> None:
        """End the run, or stand still where other robots may still have something to do."""
        text = f"{self.place.robot} lost its beacon neighbour in timestep {self._tuner.timestep}: {reason}"
        if self._schedule is Schedule.TURNS:  # all others stand and wait already
            self.finish(exit_codes.LOST, text)
        else:
            self.hold(exit_codes.LOST, text)

    def _report(self, report: Report) -> None:
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
