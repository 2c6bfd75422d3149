"""Paths on the command line: lists, refusals, and the file of a recorded leader's way."""

import json
from pathlib import Path

import pytest

from robot_formation.analysis.leader_moves import load_leader_moves, waypoint_text
from robot_formation.cli.main import main
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import load_track, override
from robot_formation.leader.paths import PATHS, make_path


def test_the_list_of_paths_has_their_parameters_with_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "paths", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["paths"]
    assert list(found) == list(PATHS)
    assert "[amplitude_m=0.3, period=36.0, phase=by seed, heading=kept]" in found["lemniscate"]
    assert "[step_m=leader.step_m]" in found["straight"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "--path", "circel"], "no path 'circel'; did you mean 'circle'?"),
        (["run", "--path", "circle", "--set", "leader.path_parameters=[perid=3]"], "did you mean 'period'?"),
        (["run", "--path", "slalom", "--set", "leader.timesteps=90"], "leader would leave the plate"),
        (["run", "--path", "waypoints"], "name its CSV file"),
        (["run", "--path", "teleop", "--in-process"], "without --in-process"),
        (["run", "--set", "leader.seed=3"], "'seed' follows from the scenario; set 'seed' instead"),
        (["sweep", "--paths", "circel"], "no path 'circel'; did you mean 'circle'?"),
        (["sweep", "--paths", "teleop"], "no path 'teleop'"),
        (["sweep", "--set", "leader.path=circle"], "a sweep sets it itself"),
        (
            ["sweep", "--tracks", "one", "--paths", "pulse", "--seeds", "0:2", "--set", "leader.timesteps=29"],
            "seed 1: path 'pulse': leader would leave the plate",
        ),
        (["path", "nowhere"], "nowhere"),
        (["path", "nowhere", "--namespace", "/a"], "nowhere"),
        (["run", "--path", "slalom", "--set", "leader.timesteps=1000"], "leader would leave the plate"),
        (["run", "--path", "circle", "--set", "leader.path_parameters=[heading=along]"], "period="),
        (["run", "--track", "one", "--set", "leader.timesteps=34", "--set", "heading_deg=270"], "leave the plate"),
    ],
)
def test_what_cannot_be_driven_is_one_line_and_exit_code_2(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    where = {"run": ["--bag", str(tmp_path / "bag")], "sweep": ["--out", str(tmp_path / "sweep")]}
    assert main([*arguments, *where.get(arguments[0], [])]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert said in output.err.splitlines()[-1]
    assert not (tmp_path / "bag").exists()


def test_the_way_of_a_recorded_leader_is_read_back_to_the_last_bit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["heading_deg=90", "leader.timesteps=2", "leader.path=circle", "world.camera.mode=on_demand"]
    settings += ["leader.path_parameters=[heading=along, radius_m=0.6, phase=0]", "fine_tuner.mode=paper"]
    scenario = override(load_track("two"), settings)
    assert run_in_process(scenario, tmp_path / "bag", {}).exit_code == 0
    planned = [scenario.leader.make_path().motion(timestep) for timestep in (1, 2)]
    moves = load_leader_moves(tmp_path / "bag")
    assert [(move.x_m, move.y_m) for move in moves] == [(move.x_m, move.y_m) for move in planned]
    assert main(["path", str(tmp_path / "bag"), "--out", str(tmp_path / "way.csv")]) == 0
    assert (tmp_path / "way.csv").read_text() == waypoint_text(moves)
    again = make_path("waypoints", [f"file={tmp_path / 'way.csv'}"])
    assert [again.motion(timestep) for timestep in (1, 2)] == moves
    capsys.readouterr()
    assert main(["path", str(tmp_path / "bag"), "--out", str(tmp_path / "way.csv")]) == 2
    assert "choose another --out" in capsys.readouterr().err


def test_a_file_in_millimetres_is_said_to_leave_the_plate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mm.csv"
    file.write_text("x_m,y_m\n" + "".join(f"{50 * k},0\n" for k in range(21)))
    way = ["--set", f"leader.path_parameters=[file={file}]", "--bag", str(tmp_path / "bag")]
    assert main(["run", "--path", "waypoints", *way]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "leader would move 50.000 m along v, beyond the drive's range" in said


def test_a_sweep_of_a_path_that_turns_warns_that_mode_paper_cannot_follow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    choice = ["--tracks", "two", "--predictors", "previous", "--seeds", "0:1", "--set", "leader.timesteps=1"]
    for number, (path, warned) in enumerate({"arc": True, "circle": False}.items()):
        assert main(["sweep", *choice, "--paths", path, "--out", str(tmp_path / str(number))]) == 0
        assert ("arc turns, which mode paper can't follow" in capsys.readouterr().err) is warned
