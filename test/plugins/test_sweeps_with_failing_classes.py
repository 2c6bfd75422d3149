"""A sweep in which classes from outside the package fail: all other runs are done and kept."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from robot_formation.cli.main import main
from robot_formation.experiment import sweep_runs
from robot_formation.experiment.sweep import Row, Task
from robot_formation.experiment.sweep_runs import FailedRunsError
from robot_formation.plugins import PluginError

TASKS = [Task("two", "plane", name, seed) for seed in (0, 1, 2) for name in ("previous", "mine:Bad", "mine:Worse")]
GOOD = {("mine:Worse", 0), ("mine:Worse", 2)}


def run_task(task: Task, settings: Sequence[str]) -> Row:
    """Make up a run; two predictors fail, one of them with a single seed."""
    if task.predictor == "mine:Bad" or task == Task("two", "plane", "mine:Worse", 1):
        raise PluginError(f"predictor '{task.predictor}': forecast failed: ValueError: {task.seed} (seed {task.seed})")
    return Row(*task, "done", 15, *[0.01] * 8)


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_runs, "run_task", run_task)


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    distributed = pytest.importorskip("dask.distributed")
    options = {"processes": False, "n_workers": 1, "threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as found:
        yield found.scheduler_address


def check(rows: Iterator[Row]) -> None:
    """Take all rows, and the error that comes after them."""
    found: list[Task] = []
    with pytest.raises(FailedRunsError) as error:
        found.extend(row.task for row in rows)
    good = [task for task in TASKS if task.predictor == "previous" or (task.predictor, task.seed) in GOOD]
    assert sorted(found) == sorted(good)
    first, second = sorted(error.value.lines)
    assert first.startswith("predictor 'mine:Bad': forecast failed: ValueError: ")
    assert first.endswith(" (2 more of its runs failed)")
    assert second == "predictor 'mine:Worse': forecast failed: ValueError: 1 (seed 1)"


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_others_are_done_on_this_machine(made_up: None, jobs: int) -> None:
    check(sweep_runs.carry_out(TASKS, (), jobs))


def test_the_others_are_done_on_a_dask_cluster(made_up: None, cluster: str) -> None:
    check(sweep_runs.carry_out_by_dask(TASKS, (), cluster))


FAILING = """
class Good:
    def observe(self, displacement):
        pass
    def forecast(self):
        return [0.0, 0.05]
class Bad(Good):
    count = 0
    def observe(self, displacement):
        self.count += 1
    def forecast(self):
        return [0.0, 0.05 / (2 - self.count)]
class Unmade(Good):
    def __init__(self):
        raise OSError('no model')
"""


def test_the_command_says_a_line_for_each_class_and_keeps_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "failing_predictors.py").write_text(FAILING)
    bad, good = "failing_predictors:Bad", "failing_predictors:Good"
    options = ["--tracks", "two", "--surfaces", "plane", "--seeds", "0:2", "--jobs", "1", "--out", "out"]
    options += ["--set", "leader.timesteps=4"]
    assert main(["sweep", *options, "--predictors", f"{bad},{good}"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    line, remedy = said.err.splitlines()[-2:]
    assert line == (
        f"formation sweep: predictor '{bad}': forecast failed: ZeroDivisionError: float division by zero "
        f"(track two, surface plane, predictor {bad}, seed 0) (1 more of its runs failed)"
    )
    assert remedy == (
        "formation sweep: 2 runs are in out; the same command with this --out goes on, also without what failed"
    )
    assert main(["sweep", *options, "--predictors", good]) == 0
    assert good in capsys.readouterr().out
    unmade = "failing_predictors:Unmade"
    assert main(["sweep", *options, "--predictors", f"{good},{unmade}"]) == 2
    assert f"predictor '{unmade}': making one without arguments failed: OSError" in capsys.readouterr().err
