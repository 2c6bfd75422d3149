"""`formation sweep` as a person types it."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from _pytest.capture import CaptureResult

from robot_formation import paths
from robot_formation.batch.resumable_table import ResumableTable
from robot_formation.cli.main import main
from robot_formation.cli.sweep import default_folder
from robot_formation.experiment import sweep, sweep_runs
from robot_formation.experiment.sweep import Row, Task
from robot_formation.experiment.sweep_results import seeds_text

pytestmark = pytest.mark.slow

CHOICE = ("--tracks", "two", "--surfaces", "plane", "--predictors", "previous,formation", "--seeds", "1000:1003")
SHORT = ("--set", "leader.timesteps=4")
ANNOUNCED = """\
seeds 1000 to 1002 (3 seeds)
warning: intervals say nothing with fewer than 5 seeds; 20 are --seeds 0:20
"""


def rows_of(folder: Path) -> list[Row]:
    """The rows of a sweep's table."""
    return list(ResumableTable(folder / sweep.RUNS_NAME, Row, sweep.SweepError, "no table of a sweep's runs").read())


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Task]:
    """The tasks that were carried out, in order; runs are made up and cost nothing."""
    tasks = []

    def run_task(task: Task, settings: Sequence[str]) -> Row:
        tasks.append(task)
        correction_m = 0.3 if task.predictor == "previous" else 0.1 + 0.001 * (task.seed % 10)
        return Row(*task, "done", 15, correction_m, *[0.01] * 7)

    monkeypatch.setattr(sweep_runs, "run_task", run_task)
    return tasks


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, CaptureResult[str]]:
    code = main(["sweep", *map(str, arguments)])
    return code, capsys.readouterr()


def complaint(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    code, said = call(capsys, *arguments)
    assert (code, said.out) == (2, "")
    *conditions, line = said.err.strip().splitlines()
    assert all("seed" in text for text in conditions)
    assert line.startswith("formation sweep: ")
    return line


# --- output -----------------------------------------------------------------------------------------------------------


def test_json_is_all_of_standard_output_and_progress_goes_to_standard_error(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    code, said = call(capsys, *CHOICE, "--jobs", 1, "--out", tmp_path / "out", "--json")
    assert code == 0
    found = json.loads(said.out)
    assert list(found)[:2] == ["runs", "summary"]
    assert (found["tracks"], found["surfaces"], found["seeds"]) == (["two"], ["plane"], [1000, 1001, 1002])
    assert (found["predictors"], found["settings"]) == (["previous", "formation"], [])
    assert found["conditions"] == {
        "mode": "paper",
        "camera": "on_demand",
        "marker": "colours",
        "followers": 1,
        "drive_mode": "pwm_stop",
        "in_process": True,
    }
    assert (found["bag"], found["reason"]) == (None, None)
    assert [Path(picture).name for picture in found["pictures"]] == ["corrections.png"]
    assert Path(found["pictures"][0]).stat().st_size > 5_000
    assert found["runs"] == str(tmp_path / "out" / "runs.csv")
    assert [(entry["predictor"], entry["runs"]) for entry in found["summary"]] == [("previous", 3), ("formation", 3)]
    assert found["summary"][1]["reduction"]["median"] == pytest.approx(1.0 - 0.101 / 0.3)
    assert said.err.splitlines()[-1].startswith("6/6 runs, ")
    assert said.err.rstrip().endswith("per minute, 0:00 left")
    written = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert written == {name: found[name] for name in written}
    assert set(found) - set(written) == {"runs", "bag", "pictures", "reason"}


def test_the_folder_holds_table_plan_and_both_summaries(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    code, said = call(capsys, *CHOICE, "--jobs", 1, "--out", tmp_path / "a" / "b")
    assert code == 0
    assert sorted(p.name for p in (tmp_path / "a" / "b").iterdir()) == [
        "corrections.png",
        "runs.csv",
        "summary.json",
        "summary.md",
        "sweep.json",
    ]
    printed = (tmp_path / "a" / "b" / "summary.md").read_text()
    assert said.out.startswith(printed)
    assert "| two | plane | formation | 3 | 0 |" in printed
    assert printed.splitlines()[-1] == (
        "Conditions: alignment paper, camera on_demand, in one process; seeds 1000 to 1002 (3 seeds)"
    )
    assert len(made) == 6


def test_without_out_a_new_folder_in_bags_is_made_each_time(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paths, "default_bags_dir", lambda: tmp_path / "bags")
    monkeypatch.setattr("time.strftime", lambda form: "20260101-120000")
    for _ in range(3):
        assert call(capsys, *CHOICE, "--jobs", 1)[0] == 0
    names = ["sweep_20260101-120000", "sweep_20260101-120000_2", "sweep_20260101-120000_3"]
    assert sorted(path.name for path in (tmp_path / "bags").iterdir()) == names
    with default_folder() as place:
        assert place.path.name == "sweep_20260101-120000_4"
    assert len(made) == 18


def test_a_finished_sweep_is_summarised_again_without_a_run(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    arguments = (*CHOICE, "--jobs", 1, "--out", tmp_path / "out", "--json")
    first = call(capsys, *arguments)[1].out
    made.clear()
    code, said = call(capsys, *arguments)
    assert (code, said.out, said.err, made) == (0, first, ANNOUNCED, [])


def test_the_summary_is_of_what_was_asked_for_though_the_table_holds_more(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    call(capsys, *CHOICE, "--jobs", 1, "--out", tmp_path / "out")
    fewer = [*CHOICE[:-1], "1001:1002"]
    found = json.loads(call(capsys, *fewer, "--jobs", 1, "--out", tmp_path / "out", "--json")[1].out)
    assert [entry["runs"] for entry in found["summary"]] == [1, 1]


def test_a_real_sweep_from_the_command_to_the_numbers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    choice = (*CHOICE[:-1], "1000", *SHORT, "--jobs", 1, "--out", tmp_path / "out", "--json")
    code, said = call(capsys, *choice)
    assert code == 0
    rows = rows_of(tmp_path / "out")
    assert [row.predictor for row in rows] == ["previous", "formation"]
    for entry, row in zip(json.loads(said.out)["summary"], rows, strict=True):
        assert entry["formation_error_rmse_m"]["median"] == row.formation_error_rmse_m


# --- interruption -----------------------------------------------------------------------------------------------------


def test_an_interrupted_sweep_ends_with_130_keeps_its_rows_and_goes_on(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = sweep_runs.carry_out

    def interrupted(tasks: Sequence[Task], settings: Sequence[str], jobs: int) -> Iterator[Row]:
        for number, row in enumerate(whole(tasks, settings, jobs)):
            if number == 4:
                raise KeyboardInterrupt
            yield row

    arguments = (*CHOICE, "--jobs", 1, "--out", tmp_path / "out", "--json")
    monkeypatch.setattr(sweep_runs, "carry_out", interrupted)
    code, said = call(capsys, *arguments)
    assert (code, said.out) == (130, "")
    assert said.err.splitlines()[-1] == (
        f"formation sweep: interrupted; the same command with --out {tmp_path / 'out'} goes on"
    )
    assert len(rows_of(tmp_path / "out")) == 4
    assert not (tmp_path / "out" / "summary.json").exists()

    monkeypatch.setattr(sweep_runs, "carry_out", whole)
    made.clear()
    code, said = call(capsys, *arguments)
    assert code == 0
    assert said.err.startswith(f"{ANNOUNCED}{tmp_path / 'out'}: 4 runs are there already, 2 are left\n")
    assert made == [Task("two", "plane", "previous", 1002), Task("two", "plane", "formation", 1002)]
    resumed = (tmp_path / "out" / "runs.csv").read_bytes()
    call(capsys, *CHOICE, "--jobs", 1, "--out", tmp_path / "whole")
    assert resumed == (tmp_path / "whole" / "runs.csv").read_bytes()


def test_a_run_that_fails_ends_the_sweep_with_one_line_and_keeps_the_others(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole: Callable[..., Row] = vars(sweep_runs)["run_task"]  # as `made` has patched it

    def run_task(task: Task, settings: Sequence[str]) -> Row:
        if len(made) == 3:
            raise sweep.SweepError("track two, seed 1001: the run stands still")
        return whole(task, settings)

    monkeypatch.setattr(sweep_runs, "run_task", run_task)
    code, said = call(capsys, *CHOICE, "--jobs", 1, "--out", tmp_path / "out", "--json")
    assert (code, said.out) == (2, "")
    assert said.err.splitlines()[-1] == "formation sweep: track two, seed 1001: the run stands still"
    assert len(rows_of(tmp_path / "out")) == 3


@pytest.mark.parametrize(
    ("chosen", "text"),
    [
        ((5,), "1 seed: 5"),
        ((0, 1, 2, 3, 4), "seeds 0 to 4 (5 seeds)"),
        ((3, 4), "seeds 3 to 4 (2 seeds)"),
        ((7, 0, 1, 9), "seeds 0 to 1, 7, 9 (4 seeds)"),
        (tuple(range(0, 60, 3)), "seeds 0, 3, 6, 9, 12, 15, 18, 21, 24, ... 57 (20 seeds)"),
    ],
)
def test_seeds_in_words(chosen: tuple[int, ...], text: str) -> None:
    assert seeds_text(chosen) == text


def test_lists_that_are_repeated_add_up_and_names_count_once(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    choice = ["--tracks", "two", "--tracks", "one,two", "--surfaces", "plane", "--surfaces", "bowl"]
    choice += ["--predictors", "previous", "--predictor", "ewma", "--seeds", "1:3", "--seeds", "2:4,9"]
    assert call(capsys, *choice, "--jobs", 1, "--out", tmp_path / "out")[0] == 0
    assert {task.track for task in made} == {"one", "two"}
    assert {task.surface for task in made} == {"plane", "bowl"}
    assert {task.predictor for task in made} == {"previous", "ewma"}
    assert {task.seed for task in made} == {1, 2, 3, 9}
    assert len(made) == len(set(made)) == 2 * 2 * 2 * 4


def test_with_five_seeds_nothing_is_warned_of(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    said = call(capsys, *CHOICE[:-1], "0:5", "--jobs", 1, "--out", tmp_path / "out")[1]
    assert "warning" not in said.err
    assert said.err.startswith("seeds 0 to 4 (5 seeds)\n")


# --- mistakes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--tracks", "tow"], ["no track 'tow'", "'two'"]),
        (["--predictors", "previous,formaton"], ["no predictor 'formaton'", "'formation'"]),
        (["--seeds", "5:5"], ["--seeds 5:5 holds no seed"]),
        (["--seeds", "few"], ["--seeds takes FIRST:END"]),
        (["--jobs", "0"], ["--jobs is at least 1, not 0"]),
        (["--set", "seed=1"], ["--set seed", "--seeds"]),
        (["--set", "predictor.forgetting=7"], ["forgetting", "outside"]),
    ],
)
def test_a_mistake_is_one_line_with_exit_code_2_and_makes_no_folder(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], options: list[str], words: list[str]
) -> None:
    line = complaint(capsys, *CHOICE, "--out", tmp_path / "out", *options)
    for word in words:
        assert word in line
    assert (made, list(tmp_path.iterdir())) == ([], [])


def test_a_folder_of_something_else_or_other_settings_and_a_file_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task]
) -> None:
    (tmp_path / "letter.txt").write_text("dear reader")
    assert "is not empty and holds no sweep" in complaint(capsys, *CHOICE, "--out", tmp_path)
    assert "letter.txt" in complaint(capsys, *CHOICE, "--out", tmp_path / "letter.txt")
    call(capsys, *CHOICE, "--jobs", 1, "--out", tmp_path / "out")
    line = complaint(capsys, *CHOICE, *SHORT, "--out", tmp_path / "out")
    assert line.endswith("other settings: it was made without --set leader.timesteps=4; choose another folder")
    call(capsys, *CHOICE, *SHORT, "--jobs", 1, "--out", tmp_path / "short")
    other = ("--set", "leader.timesteps=5")
    line = complaint(capsys, *CHOICE, *other, "--out", tmp_path / "short")
    assert "made with --set leader.timesteps=4 and without --set leader.timesteps=5" in line
    line = complaint(capsys, *CHOICE, "--out", tmp_path / "short")
    assert "made with --set leader.timesteps=4;" in line
    call(capsys, *CHOICE, *SHORT, *other, "--jobs", 1, "--out", tmp_path / "both")
    line = complaint(capsys, *CHOICE, *other, *SHORT, "--out", tmp_path / "both")
    assert "in another order, --set leader.timesteps=4 --set leader.timesteps=5;" in line
    assert (tmp_path / "letter.txt").read_text() == "dear reader"


def test_an_unknown_option_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["sweep", "--jobs", "two"])
    assert caught.value.code == 2
    assert "--jobs" in capsys.readouterr().err


def test_a_mistake_is_found_without_loading_dask_or_matplotlib() -> None:
    program = (
        "import sys; from robot_formation.cli.main import main; code = main(['sweep', '--tracks', 'tow']); "
        "print(code, [m for m in ('dask', 'distributed', 'matplotlib') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout == "2 []\n"


# --- Dask -------------------------------------------------------------------------------------------------------------


def test_dask_that_is_not_installed_is_said_with_the_command_that_installs_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    line = complaint(capsys, *CHOICE, "--dask", "tcp://127.0.0.1:8786", "--out", tmp_path / "out")
    assert line.endswith("this needs Dask: pip install 'robot_formation[dask]'")


def test_a_scheduler_that_does_not_answer_is_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("dask.distributed")
    patient = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda address, timeout: patient(address, timeout="0.3s"))
    line = complaint(capsys, *CHOICE, "--dask", "tcp://127.0.0.1:1", "--out", tmp_path / "out")
    assert "no Dask scheduler answers at tcp://127.0.0.1:1: " in line
    line = complaint(capsys, *CHOICE, "--dask", "nonsense://", "--out", tmp_path / "out")
    assert "no Dask scheduler answers at nonsense://: " in line


def test_a_failure_to_connect_without_words_is_said_too(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, made: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("dask.distributed")

    def fail(address: str, timeout: float) -> None:
        raise TimeoutError

    monkeypatch.setattr(distributed, "Client", fail)
    line = complaint(capsys, *CHOICE, "--dask", "tcp://10.0.0.1:8786", "--out", tmp_path / "out")
    assert line.endswith("no Dask scheduler answers at tcp://10.0.0.1:8786: TimeoutError")


def small_cluster() -> Any:
    """A cluster of one worker in this process."""
    distributed = pytest.importorskip("dask.distributed")
    options = {"processes": False, "n_workers": 1, "threads_per_worker": 1, "dashboard_address": ":0"}
    return distributed.LocalCluster(**options)


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    with small_cluster() as found:
        yield found.scheduler_address


def test_a_dask_cluster_yields_the_same_table_as_this_machine(cluster: str) -> None:
    tasks = [Task("two", "plane", "formation", seed) for seed in (1000, 1001)]
    settings = ("leader.timesteps=4",)
    there = {row.task: repr(row) for row in sweep_runs.carry_out_by_dask(tasks, settings, cluster)}
    here = {row.task: repr(row) for row in sweep_runs.carry_out(tasks, settings, 1)}
    assert there == here


def test_a_run_that_fails_on_a_dask_cluster_is_named(cluster: str, monkeypatch: pytest.MonkeyPatch) -> None:
    task = Task("two", "plane", "previous", 1000)
    stuck = ("leader.timesteps=4", "world.lockstep=[leader,follower_1]")
    with pytest.raises(sweep.SweepError, match=r"seed 1000: .*everybody waits"):
        list(sweep_runs.carry_out_by_dask([task], stuck, cluster))
    impossible: Any = partial(replace, 5)  # type: ignore[type-var]  # nothing that a worker could do
    monkeypatch.setattr(sweep_runs, "run_task", impossible)
    with pytest.raises(sweep.SweepError, match=r"a Dask worker can't do the runs: TypeError: .*goes on"):
        list(sweep_runs.carry_out_by_dask([task], (), cluster))


def quick_run(task: Task, settings: Sequence[str]) -> Row:
    """Make up a run, where a worker can find it."""
    return Row(*task, "done", 15, *[0.01] * 8)


def test_a_dask_cluster_that_goes_away_is_said_in_a_line_and_what_was_done_is_kept(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep_runs, "run_task", quick_run)
    add = sweep.Table.add
    with small_cluster() as cluster:

        def add_and_close(table: sweep.Table, row: Row) -> None:
            add(table, row)
            cluster.close()  # the other runs are done, or not: their results are gone with the scheduler

        monkeypatch.setattr(sweep.Table, "add", add_and_close)
        address = cluster.scheduler_address
        line = complaint(capsys, *CHOICE, "--dask", address, "--out", tmp_path / "out")
    assert line == (
        f"formation sweep: the Dask cluster at {address} is gone; the same command with the same --out goes on"
    )
    assert len(rows_of(tmp_path / "out")) == 1


@pytest.mark.parametrize("problem", [OSError("lost"), TimeoutError("lost"), CancelledError("lost")], ids=repr)
def test_a_scheduler_that_dies_while_a_result_is_fetched_is_gone(
    cluster: str, monkeypatch: pytest.MonkeyPatch, problem: Exception
) -> None:
    distributed = pytest.importorskip("dask.distributed")

    def fail(future: object) -> None:
        raise problem

    monkeypatch.setattr(sweep_runs, "run_task", quick_run)
    monkeypatch.setattr(distributed.Future, "result", fail)
    with pytest.raises(sweep.SweepError, match=r"the Dask cluster at .* is gone; .* goes on"):
        list(sweep_runs.carry_out_by_dask([Task("two", "plane", "previous", 1000)], (), cluster))
