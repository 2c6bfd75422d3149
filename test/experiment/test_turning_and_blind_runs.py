"""Whole runs of leaders that turn, and with closed eyes: in one process, from the scenario to the analysis."""

import math
import re

import numpy as np
import pytest

from robot_formation.analysis.quantities import FollowerAnalysis, analyse
from robot_formation.analysis.run_record import FollowerRecord, RunRecord
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.scenario import Scenario, load_track, override
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.parameters import ParameterError

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("turning")]
CIRCLE = ("leader.path=circle", "leader.path_parameters=[radius_m=0.6, heading=along, direction=right]")
TURN_RAD = 0.05 / 0.6


def scenario(*settings: str, timesteps: int = 14) -> Scenario:
    common = ("seed=5", "world.camera.mode=on_demand", f"leader.timesteps={timesteps}")
    return override(load_track("one"), [*common, *settings])


def follower(record: RunRecord) -> tuple[FollowerRecord, FollowerAnalysis]:
    return record.followers[0], analyse(record).followers[0]


@pytest.fixture(scope="module")
def circle() -> RunRecord:
    return run_in_memory(scenario(*CIRCLE))


@pytest.fixture(scope="module")
def blind() -> RunRecord:
    """A circle with the heading kept, blind for three timesteps once its direction is learned."""
    return run_in_memory(
        scenario("leader.path=circle", "leader.path_parameters=[period=12]", "blackouts=[[18, 3]]", timesteps=24)
    )


def test_the_follower_turns_with_its_leader_and_keeps_its_place(circle: RunRecord) -> None:
    assert analyse(circle).outcome == "done"
    _, found = follower(circle)
    assert found.totals["formation_error_rmse_m"] < 0.02
    assert abs(found.totals["heading_error_rmse_rad"]) < math.radians(3.0)
    turned = sum(timestep.moved.yaw_rad for timestep in found.timesteps)
    assert turned == pytest.approx(-14 * TURN_RAD, abs=0.15)


def test_the_heading_of_a_turning_leader_is_checked_from_where_two_faces_show(circle: RunRecord) -> None:
    recorded, found = follower(circle)
    assert sum("two faces" in text for text in recorded.states) >= 2
    # 14 timesteps of 4.8 degrees each, and a check after 11.5 degrees at the latest.
    moved = [timestep.t for timestep in found.timesteps if timestep.corrections.v_m > 0.2]
    assert len(moved) >= 3
    assert max(np.diff(moved)) <= 4


def test_a_turn_that_nothing_foretold_is_found_within_three_timesteps() -> None:
    arc = "leader.path_parameters=[radius_m=0.716, angle_deg=24, before=8, direction=right]"
    _, found = follower(run_in_memory(scenario("leader.path=arc", arc)))
    errors = [timestep.heading_error_rad for timestep in found.timesteps if timestep.heading_error_rad is not None]
    assert len(errors) == 14
    assert max(map(abs, errors[:8])) < math.radians(3.0)
    # Unnoticed, six turns of 4 degrees would be 24.
    assert max(map(abs, errors)) < math.radians(13.0)
    assert abs(errors[-1]) < math.radians(6.0)


def test_turns_are_predicted_and_their_residuals_known(circle: RunRecord) -> None:
    recorded, found = follower(circle)
    turns = [timestep.predicted_turn_rad for timestep in found.timesteps[5:]]
    assert turns == pytest.approx([-TURN_RAD] * len(turns), abs=0.05)
    assert all(residual.turn_rad is not None for residual in recorded.residuals)
    for key in ("predicted_turn_rad", "moved_turn_rad", "correction_turn_rad", "residual_turn_rad"):
        assert found.timesteps[-1].to_json()[key] is not None
    assert 0.0 <= found.totals["prediction_turn_coverage_90"] <= 1.0


def test_in_a_blackout_no_picture_is_used_and_the_residual_is_unknown(blind: RunRecord) -> None:
    recorded, found = follower(blind)
    unknown = [k for k, residual in enumerate(recorded.residuals, 1) if not residual.motion.finite]
    assert unknown == [18, 19, 20]
    for timestep in found.timesteps[17:20]:
        assert timestep.to_json()["residual_u_m"] is None
        assert (timestep.corrections.movements, timestep.corrections.turn_rad) == (0, 0.0)


def test_in_a_blackout_the_follower_drives_by_forecast_and_finds_the_leader_afterwards(blind: RunRecord) -> None:
    recorded, found = follower(blind)
    said = [text for text in recorded.states if AlignmentState.parse(text) is AlignmentState.BLIND]
    assert len(said) == 3
    assert all(re.search("driving by forecast$", text) for text in said)
    kinds = [AlignmentState.parse(text) for text in recorded.states]
    last = max(k for k, kind in enumerate(kinds) if kind is AlignmentState.BLIND)
    assert AlignmentState.REACQUIRED in kinds[last:]
    # Repeating its last displacement it would be 3 x 5 cm x 2 sin(15 deg) and more off; a third of that is the bar.
    errors = [math.hypot(*timestep.error_uv_m) for timestep in found.timesteps if timestep.error_uv_m is not None]
    assert len(errors) == 24
    assert max(errors[17:20]) < 0.03
    assert analyse(blind).outcome == "done"


def test_a_follower_that_knows_too_little_holds_still_and_says_so() -> None:
    recorded, _ = follower(
        run_in_memory(scenario("leader.path=random_walk", "seed=6", "blackouts=[[12, 8]]", timesteps=19))
    )
    said = [text for text in recorded.states if AlignmentState.parse(text) is AlignmentState.BLIND]
    assert len(said) == 8
    assert "holding still" in said[-1]
    displacements = [displacement.motion for displacement in recorded.displacements[11:]]
    held = [motion for motion, text in zip(displacements, said, strict=True) if "holding still" in text]
    assert all(math.hypot(motion.x_m, motion.y_m) < 0.001 for motion in held)


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        ("[[4, 3], [6, 1]]", "'blackouts': [6, 1] overlaps another blackout; join the two"),
        ("[[12, 4]]", "'blackouts' last until timestep 15, but the run has only 14 timesteps"),
        ("[[0, 1]]", "blackouts"),
        ("[[3]]", "blackouts"),
        ("[3, 4]", "blackouts"),
        ("soon", "blackouts"),
    ],
)
def test_wrong_blackouts_are_refused_before_anything_moves(pairs: str, words: str) -> None:
    with pytest.raises(ParameterError) as refused:
        scenario(f"blackouts={pairs}").check()
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_blackout_may_end_with_the_run() -> None:
    made = scenario("blackouts=[[2, 1], [12, 3]]")
    made.check()
    assert made.fine_tuner.blackouts == (2, 1, 12, 3)
