"""Sweeps from Python: each run is that of the scenario itself, whoever carries it out; folders go on."""

import csv
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import robot_formation as rf
from robot_formation.cli.main import main
from robot_formation.experiment import sweep as sweeps
from robot_formation.experiment import sweep_runs
from robot_formation.plugins import PluginError

pytestmark = pytest.mark.xdist_group("api_sweeps")

# A scenario unlike any track: its own place, ground, predictor's parameter and mode.
SCENARIO = rf.load_scenario("track_one").changed(
    timesteps=4,
    camera="on_demand",
    settings={
        "name": "mine",
        "start_y_m": 0.3,
        "world.surface_parameters": ["curvature_per_m=0.05"],
        "predictor.forgetting": 0.9,
        "world.overhead.enabled": False,
    },
)
PREDICTORS = ["previous", "measured"]


@pytest.fixture(scope="module")
def sweep() -> rf.Sweep:
    return rf.sweep(SCENARIO, predictors=PREDICTORS, seeds=[1, 0])


def test_each_run_is_that_of_the_scenario_itself(sweep: rf.Sweep) -> None:
    assert [(row.track, row.surface, row.path) for row in sweep.rows] == [("mine", "bowl", "straight")] * 4
    assert [(row.seed, row.predictor) for row in sweep.rows] == [(s, p) for s in (1, 0) for p in PREDICTORS]
    for row in sweep.rows[:2]:
        run = rf.run(SCENARIO.changed(seed=row.seed, predictor=row.predictor))
        assert row.outcome == run.outcome
        for name in ("correction_m", "formation_error_rmse_m", "movements_per_timestep", "heading_error_rmse_rad"):
            assert getattr(row, name) == run.totals[name]


def test_the_table_holds_the_rows(sweep: rf.Sweep) -> None:
    table = sweep.to_pandas()
    assert isinstance(table, pd.DataFrame)
    assert table.drop(columns="prediction_coverage_90").to_dict("records") == [
        {name: value for name, value in asdict(row).items() if name != "prediction_coverage_90"} for row in sweep.rows
    ]
    medians = table.groupby("predictor").correction_m.median()
    told = {entry["predictor"]: entry["correction_m"]["median"] for entry in sweep.report()["summary"]}
    assert medians.to_dict() == pytest.approx(told)


def test_what_a_sweep_says_of_itself(sweep: rf.Sweep) -> None:
    assert repr(sweep) == (
        "<Sweep 4 runs of mine; predictors previous, measured; surfaces bowl; paths straight; "
        "seeds 0 to 1 (2 seeds); 0 lost>"
    )
    assert "| mine | bowl | measured | 2 | 0 |" in sweep.summary()
    conditions = "alignment precise, camera on_demand, in one process"
    assert sweep.summary().endswith(f"Conditions: {conditions}; seeds 0 to 1 (2 seeds)")
    report = json.loads(json.dumps(sweep.report()))
    assert (report["runs"], report["tracks"], report["seeds"]) == (None, ["mine"], [1, 0])


def test_a_folder_goes_on_and_is_read_by_the_command_line(
    sweep: rf.Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = sweeps.run_task
    done: list[sweeps.Task] = []

    def run_task(task: sweeps.Task, *others: Any, **named: Any) -> sweeps.Row:
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(task)
        return whole(task, *others, **named)

    monkeypatch.setattr(sweep_runs, "run_task", run_task)
    folder = tmp_path / "sweep"
    with pytest.raises(KeyboardInterrupt):
        rf.sweep(SCENARIO, predictors=PREDICTORS, seeds=[1, 0], out=folder)
    assert len(rf.load_sweep(folder).rows) == 3

    monkeypatch.setattr(sweep_runs, "run_task", whole)
    again = rf.sweep(SCENARIO.changed(seed=77, predictor="ewma"), predictors=PREDICTORS, seeds=[1, 0], out=folder)
    assert again.rows == sweep.rows == rf.load_sweep(folder).rows
    with (folder / "runs.csv").open() as file:
        assert len(list(csv.reader(file))) == 1 + 4
    assert json.loads((folder / "summary.json").read_text())["summary"] == sweep.report()["summary"]
    assert (folder / "corrections.png").exists()
    with pytest.raises(rf.FormationError, match="another scenario"):
        rf.sweep(SCENARIO.changed(timesteps=5), predictors=PREDICTORS, seeds=[1, 0], out=folder)

    assert main(["report", str(folder), "--out", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text()
    assert "rf.sweep(scenario, predictors=[&#x27;previous&#x27;, &#x27;measured&#x27;]" in page or "rf.sweep(" in page
    assert "settings of all sweeps" not in page
    capsys.readouterr()


def test_the_code_on_a_sweeps_report_repeats_it(sweep: rf.Sweep) -> None:
    from robot_formation.reporting.sweep_sections import repeating_command

    given: dict[str, Any] = {}
    code = repeating_command(sweep.plan).replace("rf.sweep(", "again = dict(").replace("dict(scenario, ", "dict(")
    exec(code, given)
    assert given["scenario"].changed(seed=SCENARIO.seed, predictor=SCENARIO.predictor) == SCENARIO
    assert given["again"] == {"predictors": PREDICTORS, "seeds": [1, 0], "surfaces": ["bowl"], "paths": ["straight"]}


@pytest.mark.slow
def test_workers_find_the_same(sweep: rf.Sweep) -> None:
    assert rf.sweep(SCENARIO, predictors=PREDICTORS, seeds=[1, 0], jobs=2).rows == sweep.rows


def test_surfaces_paths_and_the_noise_floor(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[Any] = []

    def run_task(task: sweeps.Task, settings: Any, base: str) -> sweeps.Row:
        built.append(sweeps.build(task, settings, base))
        return sweeps.Row(*task, "done", 4, 0.1, *[0.1] * 7)

    monkeypatch.setattr(sweep_runs, "run_task", run_task)
    scenario = rf.load_scenario("track_one").changed(timesteps=4)
    found = rf.sweep(
        scenario, predictors=["ideal"], seeds=range(1), surfaces=["bowl", "plane"], paths=["straight", "circle"]
    )
    assert [(row.path, row.surface) for row in found.rows] == [
        ("straight", "bowl"), ("straight", "plane"), ("circle", "bowl"), ("circle", "plane")
    ]  # fmt: skip
    assert [(each.leader.path, each.world.surface) for each in built] == [(row.path, row.surface) for row in found.rows]
    assert built[2].world.start_x_m != built[0].world.start_x_m  # where the circle fits
    own = rf.sweep(SCENARIO, seeds=[0])
    assert (own.rows[0].predictor, built[-1].world.surface_parameters) == ("formation", ("curvature_per_m=0.05",))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"predictors": ["mesured"]}, "did you mean 'measured'"),
        ({"predictors": "measured"}, r"predictors is a list of names, like \['measured'\]"),
        ({"predictors": []}, "no predictor is given"),
        ({"surfaces": ["bowl", "bowl"]}, "a surface is given twice"),
        ({"surfaces": ["riple"]}, "did you mean 'ripple'"),
        ({"paths": ["teleop"]}, "a person drives it"),
        ({"seeds": []}, "no seed is given"),
        ({"seeds": [0.5]}, "a seed is a whole number from 0 on, not 0.5"),
        ({"seeds": [True]}, "a seed is a whole number from 0 on, not True"),
        ({"seeds": 3}, "seeds are whole numbers"),
        ({"seeds": [-1]}, "a seed is a whole number from 0 on, not -1"),
        ({"seeds": [2**80]}, "sweep: 'seed' is"),
        ({"jobs": 0}, "jobs is a whole number from 1 on, not 0"),
        ({"jobs": True}, "jobs is a whole number from 1 on, not True"),
        ({"predictors": 3}, r"predictors is a list of names, like \['formation'\], not 3"),
        ({"out": 3}, "out is a path, not 3"),
        ({"out": __file__}, "can't be used: Not a directory; choose another folder"),
        ({"out": "/proc/x"}, "/proc/x can't be used: .*choose another folder"),
        ({"jobs": 1.5}, "jobs is a whole number"),
    ],
)
def test_what_is_wrong_is_told_before_anything_is_run(
    arguments: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(sweeps, "run_task")
    with pytest.raises(rf.FormationError, match=words):
        rf.sweep(SCENARIO, **{"seeds": [0], **arguments})


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Runs that are made up, of which those by `Mine` fail with seed 1; how many jobs were asked for."""
    asked: list[int] = []

    def run_task(task: sweeps.Task, settings: Any, base: str) -> sweeps.Row:
        if (task.predictor, task.seed) == ("__main__:Mine", 1):
            raise PluginError("predictor '__main__:Mine': it failed")
        return sweeps.Row(*task, "done", 4, 0.1, *[0.1] * 7)

    def run_parallel(function: Any, arguments: Any, jobs: int) -> Any:
        asked.append(jobs)
        return (function(*entry) for entry in arguments)

    monkeypatch.setattr(sweep_runs, "run_task", run_task)
    monkeypatch.setattr(sweep_runs, "run_parallel", run_parallel)
    monkeypatch.setattr(sys.modules["__main__"], "Mine", Mine, raising=False)
    return asked


class Mine:
    """Forecasts nothing."""

    def observe(self, displacement: Any) -> None:
        pass

    def forecast(self) -> Any:
        return (0.0, 0.05)


def test_an_equal_scenario_goes_on_in_the_folder(made_up: list[int], tmp_path: Path) -> None:
    plain = rf.load_scenario("track_two").changed(timesteps=4)
    default = {"predictor.forgetting": plain.parameters["predictor.forgetting"]}
    for number, other in enumerate((plain.changed(predictor="measured"), plain.changed(settings=default))):
        for first, second in ((plain, other), (other, plain)):
            folder = tmp_path / f"{number}_{first is plain}"
            rf.sweep(first, predictors=PREDICTORS, seeds=[0], out=folder)
            assert len(rf.sweep(second, predictors=PREDICTORS, seeds=[0, 1], out=folder).rows) == 4
            with pytest.raises(rf.FormationError, match="another scenario; choose another folder"):
                rf.sweep(plain.changed(settings={"predictor.forgetting": 0.5}), seeds=[0], out=folder)


def test_a_class_of_a_notebook_runs_in_this_process_and_keeps_no_folder(made_up: list[int], tmp_path: Path) -> None:
    jobs: Any = np.int64(2)
    rf.sweep(SCENARIO, predictors=["previous", "__main__:Mine"], seeds=[0], jobs=jobs)
    rf.sweep(SCENARIO, predictors=PREDICTORS, seeds=[0], jobs=jobs)
    assert made_up == [1, 2]
    with pytest.raises(rf.FormationError, match=r"out= keeps no runs of '__main__:Mine'.*put it into a module"):
        rf.sweep(SCENARIO, predictors=["__main__:Mine"], seeds=[0], out=tmp_path / "sweep")
    assert list(tmp_path.iterdir()) == []


def test_the_runs_that_were_done_come_with_the_error_of_those_that_failed(made_up: list[int]) -> None:
    with pytest.raises(rf.FormationError, match="it failed") as error:
        rf.sweep(SCENARIO, predictors=["__main__:Mine", "previous"], seeds=[0, 1, 2])
    assert isinstance(error.value, sweep_runs.FailedRunsError)
    assert isinstance(error.value.sweep, rf.Sweep)
    assert [(row.seed, row.predictor) for row in error.value.sweep.rows] == [
        (0, "__main__:Mine"), (0, "previous"), (1, "previous"), (2, "__main__:Mine"), (2, "previous")
    ]  # fmt: skip


def test_a_folder_without_a_sweep_is_refused(tmp_path: Path) -> None:
    with pytest.raises(rf.FormationError, match="no record of a sweep"):
        rf.load_sweep(tmp_path)
    (tmp_path / "sweep.json").write_text(
        '{"tracks": ["a"], "surfaces": ["bowl"], "predictors": ["ewma"], "seeds": [1], "settings": [], "base": "[1"}'
    )
    with pytest.raises(rf.FormationError, match="no record of a sweep"):
        rf.load_sweep(tmp_path)
