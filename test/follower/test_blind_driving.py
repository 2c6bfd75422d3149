"""Timesteps without a camera: what the fine-tuner does in them, and when it rather holds still."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from alignment_helpers import blocks_of, state_of
from robot_formation.alignment.precise.motion_planner import PlannerParameters
from robot_formation.follower.actions import Done, Report, RequestFrames, SendMove
from robot_formation.follower.alignment_state import AlignmentState, State
from robot_formation.follower.blind_driving import blind_timesteps, out_of_view
from robot_formation.follower.fine_tuning import FineTuner, FineTunerParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import slot
from robot_formation.geometry.uncertain_motion import TURN_UNKNOWN, UncertainMotion
from robot_formation.parameters import ParameterError, from_mapping

PLACE = slot(0.32)

IN_PLACE = blocks_of(state_of())
STEP = Motion(0.05)


def forecast(sigma_m: float = 0.002, mean: Motion = STEP) -> UncertainMotion:
    return UncertainMotion.of(mean, np.diag([sigma_m**2, sigma_m**2, 0.005**2]))


class Script:
    """A fine-tuner whose moves go exactly as commanded."""

    def __init__(self, mode: str, blackouts: list[int]) -> None:
        values = {"mode": mode, "look": {"frames": 1, "stable_frames": 1}, "blackouts": blackouts}
        self.tuner = FineTuner(from_mapping(FineTunerParameters, values, where="test"))
        self.now_ns = 0
        self.tuner.neighbour_done(0)
        self.look()
        self.timestep = 0

    def look(self) -> list[Any]:
        self.now_ns += 1
        return self.tuner.frame(IN_PLACE, self.now_ns)

    def begin(self) -> list[Any]:
        """The next timestep's beginning."""
        self.timestep += 1
        return self.tuner.neighbour_done(self.timestep)

    def moved(self, motion: Motion) -> list[Any]:
        self.now_ns += 1
        return self.tuner.moved(motion, self.now_ns)

    def seen_timestep(self) -> None:
        """One with the camera, without corrections."""
        (move,) = [action for action in self.begin() if isinstance(action, SendMove)]
        self.moved(move.motion)
        assert any(isinstance(action, Report) for action in self.look())
        self.tuner.prediction(STEP, forecast())


def kinds(actions: list[Any]) -> list[type]:
    return [type(action) for action in actions]


@pytest.mark.parametrize("mode", ["paper", "precise"])
def test_a_blind_timestep_moves_by_forecast_and_asks_for_no_frames(mode: str) -> None:
    script = Script(mode, [3, 2])
    script.seen_timestep()
    script.seen_timestep()
    for _ in range(2):
        begun = script.begin()
        move = next(action for action in begun if isinstance(action, SendMove))
        assert move.motion.x_m == pytest.approx(0.05, abs=0.01)
        assert begun[-1] == State(AlignmentState.BLIND, "driving by forecast")
        (report,) = script.moved(move.motion)
        assert isinstance(report, Report)
        assert report.residual is None
        assert report.displacement == move.motion
        assert report.commanded is not None
        (done,) = script.tuner.prediction(STEP, forecast())
        assert done == Done(script.timestep)
    script.begin()
    assert kinds(script.moved(STEP)) == [RequestFrames]
    assert State(AlignmentState.REACQUIRED) in script.look()


@pytest.mark.parametrize("mode", ["paper", "precise"])
def test_with_a_forecast_that_is_too_uncertain_the_follower_holds_still_and_says_why(mode: str) -> None:
    script = Script(mode, [2, 1])
    (move,) = [action for action in script.begin() if isinstance(action, SendMove)]
    script.moved(move.motion)
    script.look()
    script.tuner.prediction(STEP, forecast(sigma_m=0.1))
    begun = script.begin()
    assert SendMove(Motion()) in begun
    assert "holding still" in begun[-1].text
    (report,) = script.moved(Motion())
    assert report.displacement == Motion()


@pytest.mark.parametrize(
    ("way", "sigmas", "words"),
    [
        (Motion(), (0.01, 0.01), ""),
        (Motion(x_m=0.2), (0.0, 0.0), "beside the picture"),
        (Motion(), (0.1, 0.0), "beside the picture"),
        (Motion(y_m=0.6), (0.0, 0.0), "too far"),
        (Motion(), (0.0, 0.3), "too far"),
        (Motion(y_m=-0.1), (0.0, 0.0), "in the way"),
        (Motion(), (0.0, 0.06), "in the way"),
    ],
)
def test_out_of_view_is_what_the_ellipse_of_the_neighbours_place_says(
    way: Motion, sigmas: tuple[float, float], words: str
) -> None:
    uncertain = UncertainMotion.of(way, np.diag([sigmas[0] ** 2, sigmas[1] ** 2, 0.0]))
    said = out_of_view(uncertain, PLACE, PlannerParameters())
    assert words in said
    assert bool(words) is bool(said)


def test_nothing_known_is_out_of_view() -> None:
    assert "nothing is known" in out_of_view(None, PLACE, PlannerParameters())


def test_blackouts_become_timesteps() -> None:
    assert blind_timesteps([]) == frozenset()
    assert blind_timesteps([12, 3, 4, 1]) == {4, 12, 13, 14}


@pytest.mark.parametrize(
    ("blackouts", "words"),
    [([12], "no length"), ([0, 3], "timestep 1 or later"), ([12, 0], "last 1 or more"), ([12, 3, 14, 2], "overlaps")],
)
def test_nonsense_of_blackouts_is_refused(blackouts: list[int], words: str) -> None:
    with pytest.raises(ParameterError, match=words) as caught:
        blind_timesteps(blackouts)
    assert "\n" not in str(caught.value)


def test_a_turn_that_is_forecast_is_made_with_the_prediction_move_in_precise_only() -> None:
    turning = Motion(0.05, 0.0, math.radians(-8.0))
    turns = {}
    for mode in ("paper", "precise"):
        script = Script(mode, [])
        script.seen_timestep()
        script.begin()
        script.moved(STEP)
        script.look()
        script.tuner.prediction(turning, forecast(mean=turning))
        (move,) = [action for action in script.begin() if isinstance(action, SendMove)]
        turns[mode] = move.motion.yaw_rad
    assert turns["paper"] == 0.0
    assert turns["precise"] == pytest.approx(math.radians(-8.0), abs=math.radians(1.5))


def test_a_heading_that_nobody_knows_counts_as_exact_not_as_less_than_that() -> None:
    unknown = UncertainMotion(Motion(), TURN_UNKNOWN)
    assert unknown.then(forecast(0.01)).matrix[1, 1] == pytest.approx(0.01**2)
    wide = [0.1**2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0]
    assert "beside the picture" in out_of_view(UncertainMotion(Motion(), tuple(wide)), PLACE, PlannerParameters())
