"""The follower's timestep as a state machine: wait for the neighbour, move by the prediction, look, correct, report.

Paper, fig. "algorithm scheme", with a collection phase of three timesteps in which the follower first moves by the
leader's step and then repeats its own previous displacement. Events go in, actions come out in the order to be carried
out; there is no input or output here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from robot_formation.alignment.mode import AlignmentMode, Decision, Verdict
from robot_formation.alignment.paper_mode import AlignmentParameters, PaperMode
from robot_formation.alignment.precise.precise_mode import PreciseAlignment, PreciseParameters
from robot_formation.follower.actions import Action, Done, Lost, Report, RequestFrames, SendMove, Warn
from robot_formation.follower.actuation_error import MeanActuationError
from robot_formation.follower.alignment_state import AlignmentState, State
from robot_formation.follower.blind_driving import blind_timesteps, out_of_view
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.parameters import Choice, ParameterError, parameter
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS
from robot_formation.schedule.start_rule import StartRule
from robot_formation.vision.pixy2.block import Block

_STILL_FRAMES, _STILL_PX = 10, 2
"""A robot stands still if its blocks have stayed within so many pixels for so many frames (at 5 cm/s: 7 px)."""
_STILL_FRAMES_WITHOUT_MOVE = 20
"""The same for a follower that stands itself while its neighbour moves: so long as not to take the pause between the
legs of that move for its end."""
_MORE_EXTENSIONS = 12
"""Extensions of a look at a robot that moves: up to four seconds at 30 frames per second."""
_UNTOLD = (0.01**2, 0.0, 0.0, 0.0, 0.01**2, 0.0, 0.0, 0.0, 0.02**2)
"""Covariance of the neighbour's step about a command, which has the actuation bias in it: (x, y, yaw) in m and rad."""


class AlignmentModeName(Choice):
    """How a follower uses its camera's blocks: by the rules of the paper, or with a pose filter."""

    PAPER = "paper"
    PRECISE = "precise"


@dataclass(frozen=True)
class LookParameters:
    """How long a look lasts. It must outlast the camera's block filtering, or new blocks are missed."""

    frames: int = parameter(22, "Frames of a look: block filtering 40 shows a new block in frame 21", low=1, high=600)
    stable_frames: int = parameter(3, "Last frames that must report the same blocks", low=1, high=600)
    extra_frames: int = parameter(10, "Frames asked for when the blocks are not stable", low=1, high=600)
    max_requests: int = parameter(
        3, "Requests for frames that don't come before the camera counts as dead", low=0, high=100
    )
    patience_s: float = parameter(
        60.0,
        "Wall time without a message after which missing frames are asked for; 0: never",
        unit="s",
        low=0.0,
        high=1e6,
    )
    max_extensions: int = parameter(3, "Extensions of a look before its last frame is taken as it is", low=0, high=100)


@dataclass(frozen=True)
class FineTunerParameters:
    """Parameters of the follower's fine-tuning controller."""

    mode: AlignmentModeName = parameter(AlignmentModeName.PRECISE, "How the camera's blocks are used")
    first_step_m: float = parameter(
        0.05,
        "Displacement of timestep 1 along v, known beforehand: a scenario takes it from the leader's path",
        unit="m",
        low=-0.2,
        high=0.2,
    )
    first_step_u_m: float = parameter(0.0, "The same along u", unit="m", low=-0.1, high=0.1)
    first_turn_rad: float = parameter(0.0, "Turn of timestep 1, known beforehand too", unit="rad", low=-1.1, high=1.1)
    formation_distance_m: float = parameter(
        FORMATION_DISTANCE_M,
        "Distance beside the neighbour that is kept, between the origins of base_link, along u",
        unit="m",
        low=0.05,
        high=2.0,
    )
    formation_ahead_m: float = parameter(
        0.0,
        "Offset ahead of the neighbour that is kept, between the same origins, along v; negative: behind",
        unit="m",
        low=-0.5,
        high=0.5,
    )
    # The bodies are 8 cm apart in a formation of 32 cm: a wild forecast must not push the neighbour.
    max_v_m: float = parameter(
        0.1,
        "Longest prediction move along v; longer ones are cut. A scenario raises it where the path isn't straight",
        unit="m",
        low=0.0,
        high=0.2,
    )
    max_u_m: float = parameter(
        0.05,
        "Longest prediction move along u; longer ones are cut. A scenario raises it to the bodies' gap likewise",
        unit="m",
        low=0.0,
        high=0.1,
    )
    max_turn_rad: float = parameter(
        0.35, "Largest turn of the prediction move; larger ones are cut", unit="rad", low=0.0, high=1.0
    )
    blackouts: tuple[int, ...] = parameter(
        (), "Timesteps without the camera: pairs of first timestep and length, one after another", low=1, high=1000000
    )
    calibration_file: str = parameter(
        "", "YAML file of 'formation calibrate vision': its values go before those of 'alignment'; empty: none"
    )
    look: LookParameters = LookParameters()
    alignment: AlignmentParameters = AlignmentParameters()
    precise: PreciseParameters = PreciseParameters()

    def __post_init__(self) -> None:
        """Check that the mode can keep the place, and the blackouts."""
        blind_timesteps(self.blackouts)
        if self.mode is AlignmentModeName.PAPER:
            self.alignment.check_place(self.place)
        least_m = self.precise.approach.body_width_m + self.precise.approach.clearance_m
        if self.mode is AlignmentModeName.PRECISE and self.formation_distance_m < least_m:
            raise ParameterError(
                f"fine_tuner: 'formation_distance_m' of {self.formation_distance_m} leaves less than "
                f"'precise.approach.clearance_m' between the bodies; it must be at least {least_m:.3f}"
            )

    @property
    def place(self) -> Motion:
        """The place to keep, in the neighbour's frame."""
        return Motion(self.formation_ahead_m, -self.formation_distance_m)


class Phase(Enum):
    """What the follower waits for."""

    NEIGHBOUR = auto()
    MOVE = auto()
    LOOK = auto()
    PREDICTION = auto()
    LOST = auto()


class FineTuner:
    """State machine of one follower. Stamps are integer nanoseconds of simulated time and tell which frames count."""

    def __init__(self, parameters: FineTunerParameters, rule: StartRule | None = None) -> None:
        """Begin before the first alignment.

        Args:
            parameters: of the controller.
            rule: when a timestep may begin; None: when the neighbour has finished it.
        """
        self._p = parameters
        self.rule = rule or StartRule()
        self._phase = Phase.NEIGHBOUR
        self._alignment = _mode(parameters)
        self._displacement = Motion()
        self._previous = Motion()
        self._asked = Motion()
        self._out_of_view = False
        self._resent = 0
        self._blind_timesteps = blind_timesteps(parameters.blackouts)
        self._prediction: Motion | None = None
        self._left: Motion | None = None  # the way to the place at the end of the last timestep, seen or forecast
        self._step: UncertainMotion | None = None  # the neighbour's next one, as forecast
        self._planned_move: Motion | None = None  # the prediction move, until it has ended
        self._actuation_error: Motion | None = None
        self._mean_error = MeanActuationError()
        self._frames: list[Sequence[Block]] = []
        self._frames_wanted = 0
        self._looks = 0  # in this timestep
        self._extensions = 0
        self._look_from_ns = -1
        self.timestep = 0
        self.stamp_ns = 0

    @property
    def phase(self) -> Phase:
        """What the follower waits for now."""
        return self._phase

    def neighbour_done(self, timestep: int) -> list[Action]:
        """The beacon neighbour stands at its place of this timestep."""
        self.rule.left = max(self.rule.left, timestep)
        return self.heard()

    def heard(self) -> list[Action]:
        """The start rule has heard something: begin the next timestep if that may begin now."""
        return self._begin() if self._phase is Phase.NEIGHBOUR else []

    def moved(self, motion: Motion, stamp_ns: int) -> list[Action]:
        """The drive has finished the outstanding move."""
        if self._phase is not Phase.MOVE:
            return [Warn("a 'moved' that nobody asked for is ignored")]
        self.stamp_ns = stamp_ns
        planned, self._planned_move = self._planned_move, None
        if not motion.finite:
            return [
                Warn("a 'moved' that is not finite is ignored: the displacement of this move is lost"),
                *(self._report(None) if self._blind else self._look()),
            ]
        if planned is not None:
            self._actuation_error = Motion(
                motion.x_m - planned.x_m, motion.y_m - planned.y_m, motion.yaw_rad - planned.yaw_rad
            )
            self._mean_error.learn(planned, self._actuation_error)
        self._displacement = self._displacement.then(motion)
        self._alignment.moved(self._asked, motion)
        return self._report(None) if self._blind else self._look()

    def frame(self, blocks: Sequence[Block], stamp_ns: int) -> list[Action]:
        """The camera's blocks of one frame. Only frames later than the last fact count."""
        if self._phase is not Phase.LOOK or stamp_ns <= self._look_from_ns:
            return []
        self._resent = 0
        self._frames.append(blocks)
        if len(self._frames) < self._frames_wanted:
            return []
        self.stamp_ns = stamp_ns
        at_once = self.rule.schedule.at_once
        most = max(self._p.look.max_extensions, _MORE_EXTENSIONS) if at_once else self._p.look.max_extensions
        settled = self._stable() and (not at_once or self._still())
        if not settled and self._extensions < most:
            self._extensions += 1
            self._frames_wanted += self._p.look.extra_frames
            return [RequestFrames(self._p.look.extra_frames)]
        return self._decide(self._alignment.assess(self._frames))

    def stalled(self) -> list[Action]:
        """Nothing comes any more: ask again for missing frames; a camera that stays silent loses the leader."""
        if self._phase is not Phase.LOOK:
            return []
        self._resent += 1
        if self._resent > self._p.look.max_requests:
            return self._lose("the camera gives no frames any more")
        missing = self._frames_wanted - len(self._frames)
        return [Warn(f"{missing} frames of a look are missing: asked for again"), RequestFrames(missing)]

    def prediction(self, mean: Motion | None, step: UncertainMotion | None = None) -> list[Action]:
        """The predictor's answer to this report.

        Args:
            mean: what to command as the next timestep's prediction move; None if it has none.
            step: what the neighbour's next step is expected to do to the formation position, in that position's frame;
                None if the predictor doesn't tell, so that it follows from `mean`.
        """
        if self._phase is not Phase.PREDICTION:
            return [Warn("a prediction that nobody asked for is ignored")]
        actions: list[Action] = []
        if mean is not None and mean.finite:
            self._prediction = mean
        else:
            actions.append(Warn("no finite prediction: the previous displacement is repeated"))
            self._prediction, step = self._previous, None
        self._step = step if step is not None and step.finite else self._step_of(self._prediction)
        return [*actions, *self._finish()]

    def _step_of(self, command: Motion) -> UncertainMotion:
        """Take a command for the motion to the next formation position, from what is left to the present one."""
        left = self._alignment.ahead() if self._blind else self._alignment.offset()
        return UncertainMotion((left.mean if left else Motion()).inverse().then(command), _UNTOLD)

    def _begin(self) -> list[Action]:
        if not self.rule.may_begin(self.timestep):
            return []
        step = UncertainMotion(self._first_step) if self.timestep == 1 else self._step
        self._alignment.restart(self.timestep, step)
        self._displacement = Motion()
        self._actuation_error = None
        self._looks = 0
        if self.timestep == 0:
            return [State(AlignmentState.ALIGN), *self._look()]
        return self._go()

    def _go(self) -> list[Action]:
        """Make the prediction move, and take a known heading error out with it."""
        wish = self._planned()
        turn = wish.yaw_rad if self.rule.delayed else self._alignment.turn(wish.yaw_rad)
        motion = Motion(
            _clip(wish.x_m, self._p.max_v_m), _clip(wish.y_m, self._p.max_u_m), _clip(turn, self._p.max_turn_rad)
        )
        cut = (motion.x_m, motion.y_m, motion.yaw_rad) != (wish.x_m, wish.y_m, turn)
        blind = []
        if self._blind:
            self._out_of_view = True
            expected = self._alignment.ahead()
            end = None if expected is None else expected.after(motion)
            reason = out_of_view(end, self._p.place, self._p.precise.approach)
            blind = [State(AlignmentState.BLIND, f"holding still: {reason}" if reason else "driving by forecast")]
            motion = Motion() if reason else motion
        self._planned_move = motion
        collecting = self.timestep <= COLLECTION_TIMESTEPS
        actions: list[Action] = [
            State(AlignmentState.COLLECT if collecting else AlignmentState.PREDICT),
            *self._move(motion),
            *blind,
        ]
        if cut:
            text = f"prediction (u {wish.u_m:.3f}, v {wish.v_m:.3f}) m is too long: cut"
            if abs(turn) > self._p.max_turn_rad:
                text = (
                    f"prediction (u {wish.u_m:.3f}, v {wish.v_m:.3f}) m with a turn of {turn:.3f} rad is too long: cut"
                )
            actions.insert(0, Warn(text))
        return actions

    @property
    def _first_step(self) -> Motion:
        p = self._p
        return Motion(p.first_step_m, 0.0 - p.first_step_u_m, p.first_turn_rad)

    @property
    def _blind(self) -> bool:
        """Whether the camera is not used in this timestep."""
        return self.timestep in self._blind_timesteps

    def _planned(self) -> Motion:
        if self.rule.delayed:  # the place where it was seen last
            return Motion() if self.timestep == 1 or self._left is None else self._mean_error.compensated(self._left)
        if self.timestep == 1:
            return self._first_step
        if self.timestep <= COLLECTION_TIMESTEPS or self._prediction is None:
            return self._previous
        return self._prediction

    def _look(self) -> list[Action]:
        self._phase = Phase.LOOK
        if self._looks and self.rule.neighbour_corrects(self.timestep):
            self._alignment.neighbour_corrects()
        self._looks += 1
        self._frames = []
        self._frames_wanted = self._p.look.frames
        self._extensions = 0
        self._look_from_ns = self.stamp_ns
        return [RequestFrames(self._frames_wanted)]

    def _stable(self) -> bool:
        last = self._frames[-self._p.look.stable_frames :]
        kinds = [sorted((block.signature, block.index) for block in blocks) for blocks in last]
        return all(kind == kinds[0] for kind in kinds)

    def _still(self) -> bool:
        """Whether the neighbour seems to stand: its blocks are where they were some frames ago."""
        frames = _STILL_FRAMES if self._displacement != Motion() else _STILL_FRAMES_WITHOUT_MOVE
        if len(self._frames) < frames:
            return False
        before, now = ({block.signature: block for block in self._frames[at]} for at in (-frames, -1))
        return all(
            abs(before[face].x - now[face].x) <= _STILL_PX and abs(before[face].height - now[face].height) <= _STILL_PX
            for face in before.keys() & now.keys()
        )

    def _decide(self, decision: Decision) -> list[Action]:
        if decision.verdict is Verdict.LOST:
            return self._lose(decision.reason)
        if decision.verdict is Verdict.LOOK:
            self._out_of_view = True
            return [State(AlignmentState.HOLD), *self._look()]
        if decision.verdict is Verdict.SEARCH:
            self._out_of_view = True
            return [State(AlignmentState.SEARCH, decision.reason), *self._move(decision.motion)]
        actions: list[Action] = [State(AlignmentState.REACQUIRED)] if self._out_of_view else []
        self._out_of_view = False
        uncorrected = decision.verdict is Verdict.MOVE and not self.rule.corrects(self.timestep)
        if decision.verdict is Verdict.MOVE and not uncorrected:
            return [*actions, State(AlignmentState.CORRECT, decision.reason), *self._move(decision.motion)]
        aligned = decision.verdict is Verdict.ALIGNED
        left = "left to the next move" if uncorrected else ""
        actions.append(State(AlignmentState.ALIGNED if aligned else AlignmentState.UNALIGNED, left))
        if decision.verdict is Verdict.UNALIGNED:
            actions.append(Warn(decision.reason))
        if self.timestep == 0:
            return [*actions, *self._finish()]
        return [*actions, *self._report(self._alignment.offset())]

    def _lose(self, reason: str) -> list[Action]:
        self._phase = Phase.LOST
        return [State(AlignmentState.LOST, reason), Lost(reason)]

    def _report(self, residual: UncertainMotion | None) -> list[Action]:
        self._phase = Phase.PREDICTION
        left = residual if residual is not None else self._alignment.ahead()
        self._left = left.mean if left is not None and left.finite else None
        total = self._previous = self._displacement
        commanded = None
        if (error := self._actuation_error) is not None:
            commanded = Motion(total.x_m - error.x_m, total.y_m - error.y_m, total.yaw_rad - error.yaw_rad)
        return [Report(total, residual, commanded, self._alignment.caught_up_rad())]

    def _move(self, motion: Motion) -> list[Action]:
        self._phase = Phase.MOVE
        self._asked = motion
        return [SendMove(motion)]

    def _finish(self) -> list[Action]:
        finished = self.timestep
        self.timestep += 1
        self._phase = Phase.NEIGHBOUR
        return [Done(finished), *self._begin()]


def _clip(value: float, bound: float) -> float:
    return max(-bound, min(bound, value))


def _mode(parameters: FineTunerParameters) -> AlignmentMode:
    if parameters.mode is AlignmentModeName.PAPER:
        return PaperMode(parameters.alignment.at_place(parameters.place))
    return PreciseAlignment(parameters.precise, parameters.place)
