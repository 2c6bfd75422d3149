"""Runs from Python: the same numbers as the command line's, as arrays and tables."""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import robot_formation as rf
from repository import ROOT
from robot_formation.cli.main import main
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.run_result import RunError

pytestmark = pytest.mark.xdist_group("api_runs")

SAMPLE = ROOT / "bags" / "samples" / "track_two_formation"
SHORT = rf.load_scenario("track_two").changed(seed=3, predictor="measured", camera="on_demand", timesteps=5)
COMMAND = "run --track two --seed 3 --predictor measured --camera on_demand --set leader.timesteps=5 --in-process"
COLUMNS = {
    "predicted": ("predicted_u_m", "predicted_v_m"),
    "moved": ("moved_u_m", "moved_v_m"),
    "corrections": ("correction_u_m", "correction_v_m"),
    "residual": ("residual_u_m", "residual_v_m"),
    "timesteps": "t",
    "movements": "movements",
    "formation_error": "formation_error_m",
    "heading_error": "heading_error_rad",
    "predicted_turn": "predicted_turn_rad",
    "moved_turn": "moved_turn_rad",
    "correction_turn": "correction_turn_rad",
    "residual_turn": "residual_turn_rad",
    "blind": "blind",
}


@pytest.fixture(scope="module")
def run() -> rf.Run:
    return rf.run(SHORT)


def test_the_report_is_what_the_command_line_prints_of_the_same_run(
    run: rf.Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*COMMAND.split(), "--bag", str(tmp_path / "bag"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["bag"] == str(tmp_path / "bag")
    assert json.loads(json.dumps(run.report(), allow_nan=False)) == {**printed, "bag": None}
    assert run.outcome == "done"
    assert run.totals == printed["totals"]
    assert run.bag is None

    assert main(["analyze", str(tmp_path / "bag"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == rf.analyze(tmp_path / "bag").report()

    recorded = rf.run(SHORT, bag=tmp_path / "again")
    assert recorded.report() == {**printed, "bag": str(tmp_path / "again")}
    assert recorded.summary() == run.summary()
    for array in COLUMNS:
        np.testing.assert_array_equal(
            getattr(recorded.followers["follower_1"], array), getattr(run.followers["follower_1"], array)
        )


def as_json(values: Any) -> list[Any]:
    """A column of an array as the JSON has it: None where there is NaN."""
    return [None if isinstance(value, float) and math.isnan(value) else value for value in values.tolist()]


@pytest.mark.parametrize("array", COLUMNS)
def test_arrays_are_the_columns_of_the_report(array: str, run: rf.Run) -> None:
    rows = run.report()["timesteps"]
    found = getattr(run.followers["follower_1"], array)
    names = COLUMNS[array]
    if isinstance(names, str):
        assert found.shape == (5,)
        assert as_json(found) == [row[names] for row in rows]
        return
    assert found.shape == (5, 2)
    for column, name in enumerate(names):
        assert as_json(found[:, column]) == [row[name] for row in rows]


def test_what_a_follower_and_the_leader_know(run: rf.Run) -> None:
    follower = run.followers["follower_1"]
    assert list(run.followers) == ["follower_1"]
    assert np.isnan(follower.predicted[0]).all()
    np.testing.assert_allclose(np.hypot(*follower.formation_error_uv.T), follower.formation_error, rtol=1e-12)
    assert follower.totals == run.totals
    assert not follower.lost
    for robot in (follower, run.leader):
        assert robot.moved.shape == (5, 2)
        assert robot.positions.shape == (len(robot.times), 3)
        assert robot.headings.shape == robot.times.shape
        assert (np.diff(robot.times) >= 0.0).all()
        length_m = np.linalg.norm(np.diff(robot.positions, axis=0), axis=1).sum()
        assert length_m == run.totals["path_length_m"][robot.name]
    # Steps of 5 cm along v, as the encoder wheels see them; and as the simulation knows them.
    np.testing.assert_allclose(run.leader.moved, [[0.0, 0.05]] * 5, atol=0.02)
    np.testing.assert_allclose(run.leader.positions[0, :2], (1.412, 0.111), atol=1e-3)


def test_the_table_has_a_row_per_follower_and_timestep(run: rf.Run) -> None:
    table = run.to_pandas()
    assert len(table) == 5
    assert table.follower.tolist() == ["follower_1"] * 5
    rows = run.report()["timesteps"]
    for name in table.columns[1:]:
        assert as_json(table[name]) == [row[name] for row in rows]
    assert table.dtypes["movements"].kind == "i"
    assert {table.dtypes[name].kind for name in table.columns if name.endswith(("_m", "_rad"))} == {"f"}


def test_a_table_of_nothing_has_its_keys() -> None:
    from robot_formation.api.tables import table

    assert list(table([], ("follower", "t")).columns) == ["follower", "t"]
    assert isinstance(table([{"a": None}], ()), pd.DataFrame)


def test_several_followers_have_rows_and_arrays_of_their_own() -> None:
    found = rf.run(rf.load_scenario("track_one").changed(followers=2, camera="on_demand", timesteps=2), progress=False)
    assert list(found.followers) == ["follower_1", "follower_2"]
    report = found.report()["followers"]
    for name, follower in found.followers.items():
        assert follower.moved[:, 1].tolist() == [row["moved_v_m"] for row in report[name]["timesteps"]]
    assert found.to_pandas().groupby("follower").size().tolist() == [2, 2]


def test_a_run_that_loses_its_leader_says_so_and_raises_nothing() -> None:
    found = rf.run(SHORT.changed(settings={"world.camera.pan_deg": -90}))
    assert found.outcome == "lost"
    assert found.reason
    assert found.followers["follower_1"].lost
    assert found.followers["follower_1"].moved.shape == (0, 2)
    assert found.to_pandas().empty
    assert "lost" in repr(found)


def test_progress_is_told_on_standard_error_if_it_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    rf.run(SHORT.changed(timesteps=1), progress=True)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("timestep  1/1  correction")


def test_a_bag_of_the_samples(tmp_path: Path) -> None:
    found = rf.analyze(SAMPLE)
    assert found.details["seed"] == 3
    assert found.in_process is None
    assert found.followers["follower_1"].moved.shape == (20, 2)
    assert repr(found).startswith("<Run 'track_two', done, predictor formation, surface bowl, seed 3, 20 timesteps, ")
    assert repr(found.leader) == "<Leader 'leader', 20 timesteps>"
    pictures = found.save_pictures(tmp_path / "pictures", "svg")
    assert [picture.name for picture in pictures] == [
        "trajectory.svg", "corrections.svg", "formation_error.svg", "eigenvalues.svg"
    ]  # fmt: skip


def test_what_a_caller_changes_is_not_the_run_itself(tmp_path: Path) -> None:
    found = rf.analyze(SAMPLE)
    before, summary = found.report(), found.summary()
    follower = found.followers["follower_1"]
    for robot in (follower, found.leader):
        robot.positions[:] = 0.0
        robot.headings[:] = 0.0
    given: list[Any] = [found.totals, follower.totals, found.report()["totals"]]
    for totals in given:
        totals["correction_m"] = 0.0
        totals["path_length_m"].clear()
    assert (found.report(), found.summary()) == (before, summary)
    assert found.record.tracks["leader"].positions_m.any()
    assert found.record.tracks["follower_1"].yaws_rad.any()


# --- what is wrong ----------------------------------------------------------------------------------------------------


def test_what_a_run_needs_is_named_with_the_extra_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(rf.FormationError, match=r"needs ROS 2: pip install 'robot_formation\[ros\]'"):
        rf.run(SHORT)
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(rf.FormationError, match=r"needs PyBullet and ROS 2: pip install 'robot_formation\[sim,ros\]'"):
        rf.run(SHORT)
    with pytest.raises(rf.FormationError, match="needs PyBullet"):
        rf.sweep(SHORT, seeds=[0])


def test_a_table_without_pandas_is_refused(run: rf.Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(rf.FormationError, match="to_pandas needs pandas"):
        run.to_pandas()


def test_wrong_arguments_of_a_run_are_told_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(rf.FormationError, match=r"give a scenario, like load_scenario\('track_two'\), not 'track_two'"):
        rf.run("track_two")  # type: ignore[arg-type]
    with pytest.raises(rf.FormationError, match="give bag= too"):
        rf.run(SHORT, images=True)
    with pytest.raises(rf.FormationError, match="bag is a path, not 3"):
        rf.run(SHORT, bag=3)  # type: ignore[arg-type]
    with pytest.raises(rf.FormationError, match="exists already"):
        rf.run(SHORT, bag=tmp_path)
    with pytest.raises(rf.FormationError, match="as fast as it can"):
        rf.run(SHORT.changed(settings={"world.real_time_factor": 1.0}))
    with pytest.raises(rf.FormationError, match="teleop is driven over ROS topics"):
        rf.run(SHORT.changed(path="teleop"))
    with pytest.raises(rf.FormationError, match="doesn't exist"):
        rf.analyze(tmp_path / "missing")


@pytest.mark.parametrize("recorded", [False, True])
@pytest.mark.parametrize("ended", [RunError("the run stands still"), KeyboardInterrupt()])
def test_a_run_that_fails_or_is_interrupted_raises(
    recorded: bool, ended: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def end(self: InProcessRun) -> Any:
        raise ended

    monkeypatch.setattr(InProcessRun, "_run", end)
    expected = KeyboardInterrupt if isinstance(ended, KeyboardInterrupt) else rf.FormationError
    with pytest.raises(expected, match="stands still" if expected is rf.FormationError else None):
        rf.run(SHORT, bag=tmp_path / "bag" if recorded else None)
