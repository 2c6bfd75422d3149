"""The follower's timestep cycle as a script of events, and what it does when events are wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from robot_formation.alignment.paper_mode import PaperAlignment
from robot_formation.follower.actions import Done, Lost, Report, RequestFrames, SendMove, Warn
from robot_formation.follower.alignment_state import AlignmentState, State
from robot_formation.follower.fine_tuning import FineTuner, FineTunerParameters, Phase
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

IN_PLACE = [Block(Face.TARGET, 158, 60, 49, 49, index=7)]
TOO_FAR_BACK = [Block(Face.TARGET, 200, 60, 49, 49, index=7)]  # the face is to the right in the picture, that is, ahead
FRAMES = 2


def parameters(**values: Any) -> FineTunerParameters:
    look = {"frames": FRAMES, "stable_frames": 2, "extra_frames": 3, "max_extensions": 2}
    return from_mapping(FineTunerParameters, {"mode": "paper", "look": look, **values}, where="test")


class Script:
    """A fine-tuner with a clock that counts nanoseconds, as if every event took one."""

    def __init__(self, **values: Any) -> None:
        self.parameters = parameters(**values)
        self.tuner = FineTuner(self.parameters)
        self.now_ns = 0

    def phase(self) -> Phase:
        return self.tuner.phase

    def tick(self, timestep: int) -> list[Any]:
        return self.tuner.neighbour_done(timestep)

    def moved(self, motion: Motion) -> list[Any]:
        self.now_ns += 1
        return self.tuner.moved(motion, self.now_ns)

    def frame(self, blocks: Sequence[Block]) -> list[Any]:
        self.now_ns += 1
        return self.tuner.frame(blocks, self.now_ns)

    def look(self, blocks: Sequence[Block]) -> list[Any]:
        """Show one whole look; only its last frame may have an answer."""
        for _ in range(FRAMES - 1):
            assert self.frame(blocks) == []
        return self.frame(blocks)

    def prediction(self, motion: Motion) -> list[Any]:
        return self.tuner.prediction(motion)

    def timestep(self, number: int, moved: Motion, prediction: Motion | None = None) -> list[Any]:
        """One timestep without corrections; the actions of its beginning."""
        begun = self.tick(number)
        self.moved(moved)
        self.look(IN_PLACE)
        self.prediction(moved if prediction is None else prediction)
        return begun


def after_collection(**values: Any) -> Script:
    """A fine-tuner that has finished timesteps 0 to 3 and holds the prediction (4, 4) cm for timestep 4."""
    script = Script(**values)
    script.tick(0)
    script.look(IN_PLACE)
    for number in (1, 2, 3):
        script.timestep(number, Motion(0.05), Motion.from_uv(0.04, 0.04))
    return script


def residual_of(blocks: Sequence[Block], script: Script) -> Motion:
    offset = PaperAlignment(script.parameters.alignment).offset(blocks)
    assert offset is not None
    return offset


def test_timestep_0_only_looks_corrects_and_ticks() -> None:
    script = Script()
    assert script.phase() is Phase.NEIGHBOUR
    assert script.tick(0) == [State(AlignmentState.ALIGN), RequestFrames(FRAMES)]
    assert script.phase() is Phase.LOOK
    (state, move) = script.look(TOO_FAR_BACK)
    assert state == State(AlignmentState.CORRECT, "fine-tune v")
    assert move.motion.x_m == pytest.approx(41.5 / 836.0)
    assert script.phase() is Phase.MOVE
    assert script.moved(Motion(0.05)) == [RequestFrames(FRAMES)]
    assert script.look(IN_PLACE) == [State(AlignmentState.ALIGNED), Done(0)]
    assert script.phase() is Phase.NEIGHBOUR
    assert script.tuner.timestep == 1


def test_the_whole_cycle_from_collection_to_prediction() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)

    # Collection phase: the leader's own step, ...
    assert script.tick(1) == [State(AlignmentState.COLLECT), SendMove(Motion(0.05))]
    assert script.moved(Motion(0.048, 0.001)) == [RequestFrames(FRAMES)]
    (_, correction) = script.look(TOO_FAR_BACK)
    assert isinstance(correction, SendMove)
    assert script.moved(Motion(0.004, -0.002)) == [RequestFrames(FRAMES)]
    state, report = script.look(IN_PLACE)
    assert state == State(AlignmentState.ALIGNED)
    assert isinstance(report, Report)
    assert (report.displacement.x_m, report.displacement.y_m) == pytest.approx((0.052, -0.001))
    assert report.residual is not None
    assert report.residual.mean == residual_of(IN_PLACE, script)
    assert not report.residual.turn_known
    assert script.tuner.phase is Phase.PREDICTION
    assert script.prediction(Motion(0.2, 0.1)) == [Done(1)]

    # ... then twice its own previous displacement, whatever is predicted.
    begun = script.tick(2)
    assert begun[0] == State(AlignmentState.COLLECT)
    assert (begun[1].motion.x_m, begun[1].motion.y_m) == pytest.approx((0.052, -0.001))
    script.moved(Motion(0.055, 0.002))
    script.look(IN_PLACE)
    assert script.prediction(Motion(0.2, 0.1)) == [Done(2)]
    assert script.tick(3) == [State(AlignmentState.COLLECT), SendMove(Motion(0.055, 0.002))]
    script.moved(Motion(0.051, 0.003))
    script.look(IN_PLACE)
    assert script.prediction(Motion(0.041, -0.012)) == [Done(3)]

    # From timestep 4 on the prediction.
    assert script.tick(4) == [State(AlignmentState.PREDICT), SendMove(Motion(0.041, -0.012))]
    script.moved(Motion(0.04, -0.01))
    script.look(IN_PLACE)
    assert script.prediction(Motion(0.042, -0.013)) == [Done(4)]
    assert script.tick(5) == [State(AlignmentState.PREDICT), SendMove(Motion(0.042, -0.013))]


def test_done_is_ticked_only_when_the_prediction_is_in_hand() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    script.moved(Motion(0.05))
    assert not any(isinstance(action, Done) for action in script.look(IN_PLACE))
    assert script.tick(2) == []  # nothing begins before this timestep is finished
    assert script.prediction(Motion(0.05)) == [Done(1), State(AlignmentState.COLLECT), SendMove(Motion(0.05))]


def test_the_displacement_composes_turns_between_moves() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    script.moved(Motion(0.05, 0.0, math.pi / 2))
    script.look(TOO_FAR_BACK)
    script.moved(Motion(0.02))
    (_, report) = script.look(IN_PLACE)
    found = report.displacement
    assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx((0.05, 0.02, math.pi / 2))


def test_each_timestep_starts_its_displacement_and_its_count_of_corrections_anew() -> None:
    script = Script(alignment={"max_moves": 1})
    script.tick(0)
    script.look(IN_PLACE)
    for number in (1, 2):
        script.tick(number)
        script.moved(Motion(0.05))
        assert isinstance(script.look(TOO_FAR_BACK)[1], SendMove)
        script.moved(Motion(0.01))
        (_, report) = script.look(IN_PLACE)
        assert report.displacement.x_m == pytest.approx(0.06)
        script.prediction(Motion(0.05))


def test_unaligned_after_too_many_corrections_is_warned_reported_and_goes_on() -> None:
    script = Script(alignment={"max_moves": 1})
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    script.moved(Motion(0.05))
    script.look(TOO_FAR_BACK)
    script.moved(Motion(0.01))
    state, warning, report = script.look(TOO_FAR_BACK)
    assert state == State(AlignmentState.UNALIGNED)
    assert "not aligned after 1 moves" in warning.text
    assert report.residual is not None
    assert report.residual.mean == residual_of(TOO_FAR_BACK, script)
    assert script.prediction(Motion(0.05)) == [Done(1)]


def test_without_the_target_face_the_residual_is_unknown() -> None:
    script = Script(alignment={"max_moves": 1})
    only_front = [Block(Face.FRONT, 158, 60, 40, 40)]
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    script.moved(Motion(0.05))
    script.look(only_front)
    script.moved(Motion(-0.05))
    assert script.look(only_front)[-1] == Report(Motion(0.05).then(Motion(-0.05)), None, Motion(0.0))


def test_commanded_is_the_displacement_without_what_the_prediction_move_missed() -> None:
    script = after_collection()  # with the prediction (4, 4) cm
    script.tick(4)
    script.moved(Motion.from_uv(0.037, 0.043))
    script.look(TOO_FAR_BACK)
    script.moved(Motion.from_uv(0.001, 0.011))  # a correction: what it misses is none of the command's
    (_, report) = script.look(IN_PLACE)
    assert (report.displacement.u_m, report.displacement.v_m) == pytest.approx((0.038, 0.054))
    assert (report.commanded.u_m, report.commanded.v_m) == pytest.approx((0.041, 0.051))


def test_commanded_is_of_the_move_that_was_sent_when_the_prediction_was_cut() -> None:
    script = after_collection()
    script.timestep(4, Motion(0.05), Motion.from_uv(0.15, 0.05))
    script.tick(5)
    script.moved(Motion.from_uv(0.048, 0.05))
    (_, report) = script.look(IN_PLACE)
    assert (report.commanded.u_m, report.commanded.v_m) == pytest.approx((0.05, 0.05))


def test_commanded_is_known_in_the_collection_phase_and_starts_anew_in_each_timestep() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    wish = Motion(0.05)
    for number in (1, 2, 3):
        script.tick(number)
        realised = Motion.from_uv(0.002 * number, 0.05)
        script.moved(realised)
        (_, report) = script.look(IN_PLACE)
        assert (report.commanded.x_m, report.commanded.y_m) == pytest.approx((wish.x_m, wish.y_m))
        wish = realised
        script.prediction(Motion(0.05))


def test_commanded_is_unknown_where_the_prediction_moves_end_is_but_not_where_a_corrections_is() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    script.moved(Motion(math.nan))
    script.look(TOO_FAR_BACK)
    script.moved(Motion(0.01))
    (_, report) = script.look(IN_PLACE)
    assert report.commanded is None
    script.prediction(Motion(0.05))
    script.tick(2)
    script.moved(Motion(0.012))
    script.look(TOO_FAR_BACK)
    script.moved(Motion(math.nan))
    (_, report) = script.look(IN_PLACE)
    assert report.commanded == Motion(0.01)


def test_only_frames_stamped_after_the_last_fact_count() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    assert script.tuner.frame(TOO_FAR_BACK, 50) == []  # taken on the way
    assert script.tuner.moved(Motion(0.05), 100) == [RequestFrames(FRAMES)]
    for stamp_ns in (0, 99, 100, 100):
        assert script.tuner.frame(TOO_FAR_BACK, stamp_ns) == []
    assert script.tuner.frame(IN_PLACE, 101) == []
    assert script.tuner.frame(IN_PLACE, 102)[0] == State(AlignmentState.ALIGNED)
    assert script.tuner.stamp_ns == 102


def test_a_repeated_look_does_not_count_the_frames_of_the_one_before() -> None:
    script = Script()
    script.tick(0)
    assert script.look([]) == [State(AlignmentState.HOLD), RequestFrames(FRAMES)]
    for _ in range(3):
        assert script.tuner.frame(IN_PLACE, script.now_ns) == []
    assert script.look(IN_PLACE) == [State(AlignmentState.REACQUIRED), State(AlignmentState.ALIGNED), Done(0)]


def test_a_look_whose_blocks_change_is_extended_until_they_are_stable() -> None:
    script = Script()
    script.tick(0)
    assert script.frame([]) == []
    assert script.frame(IN_PLACE) == [RequestFrames(3)]
    assert [script.frame(IN_PLACE) for _ in range(2)] == [[], []]
    assert script.frame(IN_PLACE) == [State(AlignmentState.ALIGNED), Done(0)]


def test_extensions_are_bounded_and_then_the_last_frame_decides() -> None:
    script = Script()
    script.tick(0)
    flicker = [IN_PLACE, []]
    answers = [script.frame(flicker[n % 2]) for n in range(FRAMES + 3 + 3)]
    requests = [n for n, answer in enumerate(answers) if answer == [RequestFrames(3)]]
    assert requests == [FRAMES - 1, FRAMES + 3 - 1]
    assert answers[-1] == [State(AlignmentState.HOLD), RequestFrames(FRAMES)]  # its last frame was empty


def test_another_tracking_index_is_another_block_but_order_and_place_are_not() -> None:
    for second, stable in (
        ([Block(Face.TARGET, 158, 60, 49, 49, index=8)], False),
        ([Block(Face.TARGET, 160, 61, 48, 50, index=7)], True),
    ):
        script = Script()
        script.tick(0)
        script.frame(IN_PLACE)
        assert (script.frame(second)[0] != RequestFrames(3)) == stable
    script = Script()
    script.tick(0)
    pair = [*IN_PLACE, Block(5, 20, 20, 9, 9, index=1)]
    script.frame(pair)
    assert script.frame(pair[::-1])[0] == State(AlignmentState.ALIGNED)


@pytest.mark.parametrize(
    ("wish", "cut"),
    [
        (Motion.from_uv(0.0, 0.3), Motion.from_uv(0.0, 0.1)),
        (Motion.from_uv(0.0, -0.3), Motion.from_uv(0.0, -0.1)),
        (Motion.from_uv(0.15, 0.05), Motion.from_uv(0.05, 0.05)),
        (Motion.from_uv(-0.15, 0.5), Motion.from_uv(-0.05, 0.1)),
    ],
)
def test_a_prediction_beyond_the_range_is_cut_and_said(wish: Motion, cut: Motion) -> None:
    script = after_collection()
    script.timestep(4, Motion(0.05), wish)
    warning, state, move = script.tick(5)
    assert isinstance(warning, Warn)
    assert f"(u {wish.u_m:.3f}, v {wish.v_m:.3f})" in warning.text
    assert state == State(AlignmentState.PREDICT)
    assert (move.motion.x_m, move.motion.y_m) == (cut.x_m, cut.y_m)


def test_a_prediction_at_the_end_of_the_range_is_not_cut() -> None:
    script = after_collection()
    script.timestep(4, Motion(0.05), Motion.from_uv(0.05, 0.1))
    assert script.tick(5) == [State(AlignmentState.PREDICT), SendMove(Motion.from_uv(0.05, 0.1))]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_prediction_that_is_not_finite_becomes_the_previous_displacement(bad: float) -> None:
    script = after_collection()
    script.tick(4)
    script.moved(Motion(0.047, 0.003))
    script.look(IN_PLACE)
    warning, done = script.prediction(Motion(0.05, bad))
    assert isinstance(warning, Warn)
    assert "finite" in warning.text
    assert done == Done(4)
    assert script.tick(5) == [State(AlignmentState.PREDICT), SendMove(Motion(0.047, 0.003))]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_moved_that_is_not_finite_is_said_left_out_and_its_stamp_still_tells_which_frames_count(bad: float) -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    script.tick(1)
    warning, request = script.tuner.moved(Motion(bad, 0.01), 1000)
    assert isinstance(warning, Warn)
    assert "finite" in warning.text
    assert request == RequestFrames(FRAMES)
    for stamp_ns in (999, 1000):
        assert script.tuner.frame(TOO_FAR_BACK, stamp_ns) == []
    script.now_ns = 1000
    (_, report) = script.look(IN_PLACE)
    assert report.displacement == Motion()


def in_phase(phase: Phase) -> Script:
    """A fine-tuner that waits for the event of a phase."""
    if phase is Phase.LOST:
        script = Script(alignment={"max_empty_looks": 1})
        script.tick(0)
        script.look([])
        return script
    script = after_collection() if phase is Phase.PREDICTION else Script()
    if phase is Phase.PREDICTION:
        script.tick(4)
        script.moved(Motion(0.05))
        script.look(IN_PLACE)
    elif phase is not Phase.NEIGHBOUR:
        script.tick(0)
        if phase is Phase.MOVE:
            script.look(TOO_FAR_BACK)
    return script


@pytest.mark.parametrize(
    ("phase", "unexpected"),
    [
        (Phase.NEIGHBOUR, ("moved", "frame", "prediction")),
        (Phase.LOOK, ("moved", "prediction", "tick")),
        (Phase.MOVE, ("frame", "prediction", "tick")),
        (Phase.PREDICTION, ("moved", "frame", "tick")),
        (Phase.LOST, ("moved", "frame", "prediction", "tick")),
    ],
    ids=lambda value: value.name.lower() if isinstance(value, Phase) else "",
)
def test_events_that_a_phase_does_not_wait_for_change_nothing(phase: Phase, unexpected: tuple[str, str, str]) -> None:
    script = in_phase(phase)
    assert script.tuner.phase is phase
    before = script.tuner.phase, script.tuner.timestep, script.tuner.stamp_ns
    answers: dict[str, Callable[[], list[Any]]] = {
        "moved": lambda: script.moved(Motion(0.3)),
        "frame": lambda: script.frame(TOO_FAR_BACK),
        "prediction": lambda: script.prediction(Motion(0.3)),
        "tick": lambda: script.tick(script.tuner.timestep),
    }
    for event in unexpected:
        found = answers[event]()
        assert all(isinstance(action, Warn) and "ignored" in action.text for action in found)
        assert bool(found) == (event in ("moved", "prediction"))
    assert (script.tuner.phase, script.tuner.timestep, script.tuner.stamp_ns) == before


def test_an_old_tick_of_the_neighbour_starts_nothing() -> None:
    script = Script()
    script.tick(0)
    script.look(IN_PLACE)
    assert script.tick(0) == []
    assert script.tick(1) != []


def test_a_leader_that_stays_out_of_view_is_lost_after_the_bound_of_looks() -> None:
    script = Script(alignment={"max_empty_looks": 2})
    script.tick(0)
    assert script.look([]) == [State(AlignmentState.HOLD), RequestFrames(FRAMES)]
    assert script.look([]) == [State(AlignmentState.LOST, "no block in view"), Lost("no block in view")]
    assert script.tuner.phase is Phase.LOST


def test_a_leader_that_comes_back_into_view_is_not_lost() -> None:
    script = Script(alignment={"max_empty_looks": 2})
    script.tick(0)
    for _ in range(3):
        assert script.look([]) == [State(AlignmentState.HOLD), RequestFrames(FRAMES)]
        reacquired, _, move = script.look(TOO_FAR_BACK)
        assert reacquired == State(AlignmentState.REACQUIRED)
        assert isinstance(move, SendMove)
        script.moved(Motion(0.01))
    assert script.look(IN_PLACE) == [State(AlignmentState.ALIGNED), Done(0)]
