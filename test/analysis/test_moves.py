"""Moves by axis and kind, and losses of the neighbour, of runs whose truth is known."""

import math
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.moves import UNKNOWN, Loss, losses, lost_at, move_totals, moves_of, summed
from robot_formation.analysis.quantities import FollowerAnalysis, analyse
from robot_formation.analysis.report import text_report
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Stamped
from robot_formation.bag.message_recorder import Recorder
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.scenario import load_track, override
from robot_formation.geometry.se2 import Motion

V, U, TURN = Motion(0.02), Motion.from_uv(-0.01, 0.0), Motion(yaw_rad=0.1)
SECOND = 10**9


class Story:
    """A run told event by event, a second each: moves with what is said before them, words, ends of timesteps."""

    def __init__(self) -> None:
        self.now = 0
        self.leader: list[Stamped] = []
        self.moved: list[Stamped] = []
        self.commands: list[Motion] = []
        self.said: list[tuple[str, int]] = []
        self.displacements: list[Stamped] = []

    def tick(self) -> None:
        self.now += SECOND

    def say(self, text: str) -> "Story":
        self.tick()
        self.said.append((text, self.now))
        return self

    def step(self, opening: str = "predict") -> "Story":
        self.tick()
        self.leader.append(Stamped(self.now, Motion(0.05)))
        return self.move(Motion(0.05), opening)

    def move(self, command: Motion, text: str | None = None) -> "Story":
        if text:
            self.say(text)
        self.tick()
        self.commands.append(command)
        # What the wheels measured has something of every axis.
        self.moved.append(Stamped(self.now, Motion(command.x_m + 1e-3, command.y_m - 2e-3, command.yaw_rad + 0.01)))
        return self

    def done(self) -> "Story":
        self.tick()
        self.displacements.append(Stamped(self.now, Motion(0.05)))
        return self

    def follower(self, *, commands: bool = True, stamps: bool = True) -> FollowerRecord:
        return FollowerRecord(
            "follower_1",
            tuple(self.moved),
            tuple(self.displacements),
            states=tuple(text for text, _ in self.said),
            state_stamps_ns=tuple(stamp for _, stamp in self.said) if stamps else (),
            commands=tuple(self.commands) if commands else (),
        )

    def analysed(self, **options: bool) -> FollowerAnalysis:
        return analyse(RunRecord(tuple(self.leader), (self.follower(**options),))).followers[0]


def three_timesteps() -> Story:
    """Timestep 0 with a move, then one of two kinds, one without any, one with a search."""
    story = Story().say("align").move(U, "correct: fine-tune u").say("aligned")
    story.step("collect").move(V, "correct: fine-tune v").move(V, "correct: fine-tune v")
    story.move(U, "correct: fine-tune u").say("aligned").done()
    story.step("collect").say("aligned").done()
    story.step().say("hold").say("hold").move(TURN, "search: out of view").say("reacquired")
    return story.move(TURN, "correct: turn").say("aligned").done()


def test_moves_are_counted_by_commanded_axis_and_by_what_was_said_of_them() -> None:
    rows = [timestep.to_json() for timestep in three_timesteps().analysed().timesteps]
    assert [row["moves_by_axis"] for row in rows] == [
        {"u": 1, "v": 2, "turn": 0},
        {"u": 0, "v": 0, "turn": 0},
        {"u": 0, "v": 0, "turn": 2},
    ]
    assert [row["moves_by_kind"] for row in rows] == [
        {"correct: fine-tune v": 2, "correct: fine-tune u": 1},
        {},
        {"search: out of view": 1, "correct: turn": 1},
    ]
    assert [row["correction_turn_rad"] for row in rows] == pytest.approx([0.03, 0.0, 0.22])


def test_totals_add_up_the_timesteps_without_the_initial_alignment() -> None:
    totals = three_timesteps().analysed().totals
    assert totals["moves_by_axis"] == {"u": 1, "v": 2, "turn": 2}
    assert sum(totals["moves_by_kind"].values()) == totals["movements"] == 5
    assert (totals["movements_median"], totals["movements_max"]) == (2, 3)


def test_a_loss_lasts_from_the_first_look_in_vain_to_the_look_that_shows_the_neighbour() -> None:
    totals = three_timesteps().analysed().totals
    # hold, hold, search, its move, reacquired: four seconds from the first to the last.
    assert totals["losses"] == [{"t": 3, "looks": 3, "moves": 1, "seconds": 4.0, "reacquired": True}]
    assert (totals["reacquired"], totals["reacquisition_median_s"], totals["reacquisition_max_s"]) == (1, 4.0, 4.0)


def test_several_losses_are_told_apart_and_their_times_summarised() -> None:
    story = Story().say("align").say("hold").say("reacquired").say("aligned")
    story.step("collect").say("hold").say("hold").say("hold").say("reacquired").say("aligned").done()
    story.step("collect").say("hold").move(U, "search: x").say("lost")
    follower = story.follower()
    assert losses(follower) == (
        Loss(0, 1, 0, 1.0, True),
        Loss(1, 3, 0, 3.0, True),
        Loss(2, 2, 1, 3.0, False),
    )
    totals = story.analysed().totals
    assert (totals["reacquired"], totals["reacquisition_median_s"], totals["reacquisition_max_s"]) == (2, 2.0, 3.0)


def test_a_camera_that_falls_silent_is_a_loss_without_a_look_in_vain() -> None:
    story = Story().say("align").say("aligned").step().say("lost")
    assert losses(story.follower()) == (Loss(1, 0, 0, 0.0, False),)


def test_a_record_that_ends_during_a_loss_has_it_as_not_reacquired() -> None:
    story = Story().say("align").step().say("hold").move(U, "search: x")
    assert losses(story.follower()) == (Loss(1, 2, 1, 1.0, False),)


def test_without_stamps_or_commands_what_they_tell_is_unknown_and_the_rest_is_not() -> None:
    analysis = three_timesteps().analysed(commands=False, stamps=False)
    assert analysis.timesteps[0].moves.axes is None
    assert analysis.totals["moves_by_axis"] is None
    assert analysis.totals["moves_by_kind"]["correct: fine-tune v"] == 2
    assert analysis.totals["losses"][0]["seconds"] is None
    assert (analysis.totals["reacquired"], analysis.totals["reacquisition_median_s"]) == (1, None)


def test_a_move_that_nobody_explained_is_of_unknown_kind() -> None:
    story = Story().step().move(V, "correct: fine-tune v").move(U).done()
    assert story.analysed().timesteps[0].moves.kinds == {"correct: fine-tune v": 1, UNKNOWN: 1}


@pytest.mark.parametrize(
    ("motion", "axes"),
    [
        (Motion(0.02, -0.01, 0.1), (1, 1, 1)),
        (Motion(0.02, 0.01), (1, 1, 0)),
        # The drive turns first: a move straight ahead after the turn is no move along u.
        (Motion(0.05 * math.cos(0.3), 0.05 * math.sin(0.3), 0.3), (0, 1, 1)),
        (Motion(5e-5, 5e-5, 5e-5), (0, 0, 0)),
    ],
)
def test_a_move_of_several_legs_counts_for_each_of_its_axes(motion: Motion, axes: tuple[int, int, int]) -> None:
    moves = Story().step().move(motion, "correct: x").done().analysed().timesteps[0].moves
    assert moves.axes is not None
    assert tuple(moves.axes.values()) == axes


def test_a_run_without_timesteps_has_no_moves() -> None:
    assert move_totals([], [], FollowerRecord("follower_1")) == {
        "moves_by_axis": {"u": 0, "v": 0, "turn": 0},
        "moves_by_kind": {},
        "movements_median": None,
        "movements_max": None,
        "losses": [],
        "lost": None,
        "reacquired": 0,
        "reacquisition_median_s": None,
        "reacquisition_max_s": None,
    }


@given(
    steps=st.lists(
        st.lists(st.sampled_from([(V, "correct: v"), (U, "correct: u"), (TURN, "search: s")]), max_size=4), max_size=5
    )
)
def test_kinds_and_axes_add_up_to_the_moves_of_every_timestep(steps: list[list[tuple[Motion, str]]]) -> None:
    story = Story().say("align").say("aligned")
    for entries in steps:
        story.step()
        for command, text in entries:
            story.move(command, text)
        story.say("aligned").done()
    follower = story.follower()
    found, start = [], 0
    for t, entries in enumerate(steps, 1):
        found.append(moves_of(follower, range(start, start + 1 + len(entries)), t))
        start += 1 + len(entries)
        assert found[-1].kinds == Counter(text for _, text in entries)
        assert found[-1].axes is not None
        assert sum(found[-1].axes.values()) == len(entries)
    assert sum(summed(found).kinds.values()) == sum(map(len, steps))


def test_the_report_tells_axes_kinds_and_losses() -> None:
    story = three_timesteps()
    record = RunRecord(tuple(story.leader), (story.follower(),))
    report = text_report(record, analyse(record))
    assert "by axis" in report
    assert "u 1, v 2, turn 2" in report
    assert "correct: fine-tune v (2)" in report
    assert "neighbour out of view" in report
    assert "1, 1 of them reacquired (median 4.0 s, longest 4.0 s)" in report


def test_a_bag_and_the_run_in_memory_give_the_same_analysis(tmp_path: Path) -> None:
    settings = ["seed=2", "leader.timesteps=3", "world.camera.mode=on_demand", "world.overhead.enabled=false"]
    scenario = override(load_track("two"), settings)
    recorder = Recorder(tmp_path / "run", {"scenario": "track_two", "timesteps": "3", "outcome": "done"})
    InProcessRun(scenario, recorder).run()
    recorder.close()
    from_bag, in_memory = load_run(tmp_path / "run"), run_in_memory(scenario)
    follower = from_bag.followers[0]
    assert follower == in_memory.followers[0]
    assert len(follower.commands) == len(follower.moved) > 4
    assert list(follower.state_stamps_ns) == sorted(follower.state_stamps_ns)
    assert analyse(from_bag).to_json()["timesteps"] == analyse(in_memory).to_json()["timesteps"]


def test_a_follower_that_gave_up_is_told_with_timestep_time_and_reason() -> None:
    states = ("align", "aligned", "collect", "hold", "lost: not found again in 4 looks")
    follower = FollowerRecord("follower_1", states=states, state_stamps_ns=(0, 1, 2, 3, 4_500_000_000))
    assert lost_at(follower) == {"t": 1, "seconds": 4.5, "reason": "not found again in 4 looks"}
    older = FollowerRecord("follower_1", states=("align", "lost"))
    assert lost_at(older) == {"t": 0, "seconds": None, "reason": None}
    assert lost_at(FollowerRecord("follower_1", states=states[:-1])) is None
