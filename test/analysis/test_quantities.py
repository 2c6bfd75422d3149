"""The project's quantities against runs whose truth is known."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_formation.analysis.errors import AnalysisError
from robot_formation.analysis.from_bag import load_run, read_ground
from robot_formation.analysis.quantities import RunAnalysis, analyse, corrections_of
from robot_formation.analysis.report import to_json
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Stamped, Track
from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.writer import BagWriter
from robot_formation.geometry.se2 import Motion
from synthetic_bag import STEPS, Step, SyntheticRun, surface_marker, write_run

ROW_KEYS = [
    "t",
    "predicted_u_m",
    "predicted_v_m",
    "moved_u_m",
    "moved_v_m",
    "correction_u_m",
    "correction_v_m",
    "residual_u_m",
    "residual_v_m",
    "movements",
    "formation_error_m",
    "heading_error_rad",
    "predicted_turn_rad",
    "moved_turn_rad",
    "correction_turn_rad",
    "residual_turn_rad",
    "blind",
    "moves_by_axis",
    "moves_by_kind",
]


def analysed(tmp_path: Path, steps: Sequence[Step] = STEPS, **options: Any) -> RunAnalysis:
    return analyse(load_run(write_run(tmp_path / "run", steps, **options)))


def test_rows_hold_the_truth_with_u_to_the_right_and_v_forward(tmp_path: Path) -> None:
    rows = analysed(tmp_path).to_json()["timesteps"]
    assert [list(row) for row in rows] == [ROW_KEYS] * 5
    row = rows[3]
    expected = {
        "t": 4,
        "predicted_u_m": 0.031,
        "predicted_v_m": 0.053,
        "moved_u_m": 0.040,
        "moved_v_m": 0.047,
        "correction_u_m": 0.011,
        "correction_v_m": 0.032,
        "residual_u_m": 0.004,
        "residual_v_m": -0.005,
        "movements": 4,
        "formation_error_m": 0.05,
        "heading_error_rad": -0.3,
    }
    assert {key: row[key] for key in expected} == pytest.approx(expected, abs=1e-12)


def test_predictions_belong_to_the_timestep_after_the_one_they_follow(tmp_path: Path) -> None:
    rows = analysed(tmp_path).to_json()["timesteps"]
    assert [row["predicted_u_m"] for row in rows] == pytest.approx([None, 0.011, 0.021, 0.031, -0.032])


def test_totals_count_corrections_after_the_collection_phase_and_all_movements(tmp_path: Path) -> None:
    totals = analysed(tmp_path, details={"timesteps": "5"}).to_json()["totals"]
    assert totals["correction_u_m"] == pytest.approx(0.011)
    assert totals["correction_v_m"] == pytest.approx(0.052)
    assert totals["correction_m"] == pytest.approx(0.063)
    assert totals["correction_turn_rad"] == pytest.approx(0.3)
    assert totals["movements"] == 7
    assert totals["movements_per_timestep"] == pytest.approx(1.4)
    assert (totals["timesteps_finished"], totals["timesteps_planned"]) == (5, 5)
    assert totals["unfinished_timestep"] is None


def test_formation_error_is_split_into_bias_and_scatter(tmp_path: Path) -> None:
    totals = analysed(tmp_path).to_json()["totals"]
    errors = np.array([step.error for step in STEPS])
    bias = errors.mean(axis=0)
    assert totals["formation_error_rmse_m"] == pytest.approx(math.sqrt((errors**2).sum(axis=1).mean()))
    assert (totals["formation_error_bias_u_m"], totals["formation_error_bias_v_m"]) == pytest.approx(tuple(bias))
    parts = totals["formation_error_scatter_m"] ** 2 + (bias**2).sum()
    assert parts == pytest.approx(totals["formation_error_rmse_m"] ** 2)
    assert totals["heading_error_rmse_rad"] == pytest.approx(0.3 / math.sqrt(5))


def test_path_length_and_simulated_time(tmp_path: Path) -> None:
    totals = analysed(tmp_path).to_json()["totals"]
    assert list(totals["path_length_m"]) == ["leader", "follower_1"]
    assert totals["path_length_m"]["leader"] == pytest.approx(0.25, rel=0.02)
    events = 1 + sum(3 + len(step.corrections) + len(step.turns) for step in STEPS)
    assert totals["simulated_seconds"] == pytest.approx(events)


def test_top_level_keys_and_outcome_of_a_finished_run(tmp_path: Path) -> None:
    result = analysed(tmp_path, details={"scenario": "track two", "timesteps": "5"}).to_json()
    assert list(result) == ["scenario", "outcome", "timesteps", "totals"]
    assert (result["scenario"], result["outcome"]) == ("track two", "done")


def test_a_lost_run_lists_the_finished_timesteps_and_tells_of_the_last(tmp_path: Path) -> None:
    steps = [*STEPS[:4], Step(corrections=[(0.03, 0.0), (0.0, -0.04)], turns=[0.2], finished=False)]
    result = analysed(tmp_path, steps, details={"timesteps": "20"}, lost=["follower_1"]).to_json()
    assert result["outcome"] == "lost"
    assert len(result["timesteps"]) == 4
    expected = {
        "t": 5,
        "correction_u_m": 0.03,
        "correction_v_m": 0.04,
        "correction_turn_rad": 0.2,
        "movements": 3,
    }
    assert result["totals"]["unfinished_timestep"] == pytest.approx(expected)
    assert result["totals"]["correction_u_m"] == pytest.approx(0.011)


@pytest.mark.parametrize(("planned", "outcome"), [("5", "done"), ("6", "incomplete"), (None, "done"), ("", "done")])
def test_a_run_is_done_when_it_has_its_planned_timesteps(tmp_path: Path, planned: str | None, outcome: str) -> None:
    details = None if planned is None else {"timesteps": planned}
    assert analysed(tmp_path, details=details).outcome == outcome


def test_without_a_plan_an_unfinished_timestep_makes_a_run_incomplete(tmp_path: Path) -> None:
    assert analysed(tmp_path, [*STEPS, Step(finished=False)]).outcome == "incomplete"


def test_several_followers_are_measured_against_their_own_neighbours(tmp_path: Path) -> None:
    result = analysed(tmp_path, followers=3).to_json()
    assert list(result) == ["scenario", "outcome", "timesteps", "totals", "followers", "string_stability"]
    assert [hop["robot"] for hop in result["string_stability"]["hops"]] == ["follower_2", "follower_3"]
    assert list(result["followers"]) == ["follower_1", "follower_2", "follower_3"]
    assert result["followers"]["follower_1"] == {key: result[key] for key in ("timesteps", "totals")}
    # Every follower has the same error in the leader's frame: straight behind one another the second one has none,
    # but a neighbour that is turned by -0.3 rad expects it elsewhere.
    second = [row["formation_error_m"] for row in result["followers"]["follower_2"]["timesteps"]]
    assert second == pytest.approx([0.0, 0.0, 0.0, 2 * 0.32 * math.sin(0.15), 0.0], abs=1e-9)


def test_a_run_cut_before_its_first_timestep_has_no_rows_and_no_sums(tmp_path: Path) -> None:
    result = analysed(tmp_path, [], details={"timesteps": "20"}).to_json()
    assert (result["outcome"], result["timesteps"]) == ("incomplete", [])
    assert result["totals"]["correction_m"] is None
    assert result["totals"]["movements_per_timestep"] is None
    assert result["totals"]["formation_error_rmse_m"] is None


def test_json_is_strict_also_for_residuals_that_nobody_saw(tmp_path: Path) -> None:
    steps = [Step(residual=(math.nan, math.nan), prediction=(math.nan, 0.0)), Step()]
    rows = json.loads(to_json(analysed(tmp_path, steps).to_json()))["timesteps"]
    assert rows[0]["residual_u_m"] is None
    assert rows[1]["predicted_v_m"] is None


def test_a_record_without_its_start_is_refused() -> None:
    moves = (Stamped(1, Motion()),)
    follower = FollowerRecord("follower_1", displacements=(*moves, *moves))
    with pytest.raises(AnalysisError, match="record's start is missing"):
        analyse(RunRecord(moves, (follower,)))
    with pytest.raises(AnalysisError, match="no follower"):
        analyse(RunRecord(moves, ()))


def test_without_ground_truth_errors_are_null_and_the_rest_is_there() -> None:
    leader = (Stamped(10, Motion(0.05)),)
    moved = (Stamped(5, Motion(1.0)), Stamped(20, Motion(0.05)), Stamped(30, Motion(0.0, 0.02)))
    follower = FollowerRecord("follower_1", moved, displacements=(Stamped(40, Motion(0.05, 0.02)),))
    (row,) = analyse(RunRecord(leader, (follower,))).to_json()["timesteps"]
    assert row["formation_error_m"] is None
    assert row["heading_error_rad"] is None
    assert row["residual_u_m"] is None
    assert (row["movements"], row["correction_u_m"], row["moved_u_m"]) == (1, 0.02, -0.02)


def test_ground_truth_is_the_last_pose_at_or_before_the_report() -> None:
    track = Track(
        np.array([10, 20, 30]), np.array([[1.0, 0, 0], [2.0, 0, 0], [2.0, 3.0, 4.0]]), np.array([0.1, 0.2, 0.3])
    )
    assert track.at(9) is None
    first, last = track.at(10), track.at(29)
    assert first is not None
    assert first.x_m == 1.0
    assert last is not None
    assert last.yaw_rad == 0.2
    assert track.length_m == 6.0


@pytest.mark.parametrize(
    ("fine_tuner", "distance_m"),
    [
        ({"formation_distance_m": 0.5}, 0.5),
        ({}, 0.32),
        ({"formation_distance_m": "far"}, 0.32),
        ({"formation_distance_m": math.nan}, 0.32),
    ],
)
def test_the_formation_distance_is_that_of_the_runs_fine_tuner(
    fine_tuner: dict[str, object], distance_m: float
) -> None:
    details = {"parameters": json.dumps({"fine_tuner": fine_tuner})}
    assert RunRecord((), (), details=details).formation_distance_m == distance_m


def test_a_run_that_says_nothing_has_the_papers_formation_distance() -> None:
    assert RunRecord((), ()).formation_distance_m == 0.32


def test_the_first_move_of_a_timestep_is_no_correction() -> None:
    follower = FollowerRecord("follower_1", moved=(Stamped(0, Motion(1.0, 1.0, 1.0)),))
    assert corrections_of(follower, [0]).movements == 0
    assert corrections_of(follower, []).u_m == 0


def test_a_move_along_v_and_one_along_u_are_two_movements_in_one_command_too() -> None:
    moves = [Motion(), Motion(0.02, 0.0), Motion(0.02, 0.01), Motion(0.02, 0.01, 0.1), Motion()]
    moved = tuple(Stamped(0, motion) for motion in moves)
    told = FollowerRecord("follower_1", moved=moved, commands=tuple(moves))
    assert corrections_of(told, range(5)).movements == 1 + 2 + 3 + 1
    untold = FollowerRecord("follower_1", moved=moved)
    assert corrections_of(untold, range(5)).movements == 4


def test_bags_without_a_formation_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/words", "std_msgs/msg/String", TopicQos())
        writer.write("/words", b"\x00\x01\x00\x00\x01\x00\x00\x00\x00", 0)
    with pytest.raises(AnalysisError, match="no formation run"):
        load_run(tmp_path / "run")


def test_a_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/follower_1/moved", "std_msgs/msg/String", TopicQos())
        writer.write("/follower_1/moved", b"\x00\x01\x00\x00\x01\x00\x00\x00\x00", 0)
    with pytest.raises(BagError, match="PoseWithCovarianceStamped is needed"):
        load_run(tmp_path / "run")


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e300])
def test_a_ground_with_a_corner_that_is_no_place_is_none(wrong: float) -> None:
    marker = surface_marker(cells=2)
    assert read_ground(marker) is not None
    marker.points[3].z = wrong
    assert read_ground(marker) is None


def test_the_ground_comes_from_the_surface_marker(tmp_path: Path) -> None:
    ground = load_run(write_run(tmp_path / "run", STEPS[:1])).ground
    assert ground is not None
    assert ground.vertices_m.shape == (25 * 25, 3)
    assert ground.triangles.shape == (2 * 24 * 24, 3)
    x, y, z = ground.vertices_m.T
    np.testing.assert_allclose(z, 0.05 + ((x - 0.89) ** 2 + (y - 0.89) ** 2) / 10.0, atol=1e-6)
    assert load_run(write_run(tmp_path / "bare", STEPS[:1], surface=False)).ground is None


def test_later_metadata_records_add_to_earlier_ones(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.write_metadata(METADATA_NAME, {"scenario": "track one", "seed": "3"})
        SyntheticRun(writer)
        writer.write_metadata(METADATA_NAME, {"outcome": "lost"})
    record = load_run(tmp_path / "run")
    assert record.details == {"scenario": "track one", "seed": "3", "outcome": "lost"}
    assert analyse(record).outcome == "lost"
