"""Sweeps: plans, the growing table, resuming, and runs that don't depend on who carries them out."""

import csv
import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.cli.sweep import seeds
from robot_formation.errors import FormationError
from robot_formation.experiment import sweep, sweep_runs
from robot_formation.experiment.sweep import Plan, Row, SweepError, Table, Task
from robot_formation.koopman.predictors import NAMES

pytestmark = pytest.mark.xdist_group("sweep")

SHORT = ("leader.timesteps=4",)
PLAN = Plan(("two",), ("plane",), ("previous", "ideal+close"), (1000, 1001), SHORT)
NUMBERS = [field.name for field in fields(Row)][7:]


def row_of(task: Task, correction_m: float = 0.1) -> Row:
    return Row(*task, "done", 15, correction_m, *[0.25] * (len(NUMBERS) - 1))


def lines_of(folder: Path) -> list[bytes]:
    return (folder / "runs.csv").read_bytes().splitlines(keepends=True)


def filled(folder: Path, plan: Plan = PLAN, count: int = 4) -> Table:
    """A table with the first rows of a plan."""
    table = Table(folder, plan)
    for number, task in zip(range(count), plan.tasks(), strict=False):
        table.add(row_of(task, 0.1 * (number + 1) / 3.0))
    return table


# --- plans ------------------------------------------------------------------------------------------------------------


def test_a_plan_that_can_be_run_passes_with_every_predictor_and_the_noise_floors() -> None:
    Plan(("one", "two"), ("bowl", "ripple"), (*NAMES, "ideal", "ideal+close"), (0,)).check()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"tracks": ("tow",)}, ["no track 'tow'", "did you mean 'two'"]),
        ({"surfaces": ("bowl", "riple")}, ["no surface 'riple'", "did you mean 'ripple'"]),
        ({"predictors": ("previous", "mesured")}, ["no predictor 'mesured'", "did you mean 'measured'"]),
        ({"predictors": ("ideal+clos",)}, ["did you mean 'ideal+close'"]),
        ({"tracks": ()}, ["no track is given"]),
        ({"surfaces": ()}, ["no surface is given"]),
        ({"predictors": ()}, ["no predictor is given"]),
        ({"seeds": ()}, ["no seed is given", "--seeds 0:200"]),
        ({"tracks": ("two", "one", "two")}, ["a track is given twice"]),
        ({"surfaces": ("plane", "plane")}, ["a surface is given twice"]),
        ({"predictors": ("ewma", "ewma")}, ["a predictor is given twice"]),
        ({"settings": ("predictor.name=ewma",)}, ["--set predictor.name", "--predictors"]),
        ({"settings": ("world.surface=bowl",)}, ["--set world.surface", "--surfaces"]),
        ({"settings": ("seed=3",)}, ["--set seed", "--seeds"]),
        ({"settings": ("predictor.forgeting=0.9",)}, ["'forgeting'", "'forgetting'"]),
        ({"settings": ("leader.timesteps=many",)}, ["timesteps"]),
        ({"settings": ("leader.timesteps",)}, ["KEY=VALUE"]),
    ],
)
def test_a_wrong_plan_is_refused_with_one_line_that_names_the_mistake(change: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(FormationError) as caught:
        replace(PLAN, **change).check()
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_tasks_are_every_combination_once_and_all_of_a_seed_together() -> None:
    plan = Plan(("one", "two"), ("bowl", "plane"), ("previous", "ewma"), (3, 1))
    tasks = list(plan.tasks())
    assert len(set(tasks)) == len(tasks) == 16
    assert [task.seed for task in tasks] == [3] * 8 + [1] * 8
    assert [task.predictor for task in tasks] == ["previous", "ewma"] * 8


def test_a_runs_conditions_are_the_papers_fine_tuner_and_pictures_on_demand() -> None:
    scenario = sweep.build(Task("two", "ripple", "ewma+close", 7), ("predictor.ewma.gain=0.3",))
    assert scenario.setup.seed == 7
    assert scenario.world.surface == "ripple"
    assert scenario.world.camera.mode == "on_demand"
    assert scenario.fine_tuner.mode == "paper"
    assert scenario.predictor.name == "ewma+close"
    assert scenario.predictor.ewma.gain == 0.3


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0:3", (0, 1, 2)),
        ("7", (7,)),
        ("7,3:5,4:6", (7, 3, 4, 5)),
        ("1000:1001", (1000,)),
        ("0", (0,)),
        ("09:11", (9, 10)),
    ],
)
def test_seeds_are_first_to_before_the_end_or_one(text: str, expected: tuple[int, ...]) -> None:
    assert seeds(text) == expected


@pytest.mark.parametrize(
    "text", ["", ":", "3:", ":3", "3:3", "4:2", "-1:3", "0:2:1", "a:b", "1.5", "0, 1", "0:9999999", "9" * 30, "0:3\n"]
)
def test_other_seeds_are_refused_with_one_line(text: str) -> None:
    with pytest.raises(FormationError, match="--seeds"):
        seeds(text)


# --- the table --------------------------------------------------------------------------------------------------------

number = st.one_of(st.none(), st.floats(allow_nan=False, allow_infinity=False))


@given(
    st.builds(
        Row,
        track=st.sampled_from(["one", "two"]),
        surface=st.just("bowl"),
        predictor=st.sampled_from(["previous", "ideal+close"]),
        seed=st.integers(0, 2**60),
        path=st.sampled_from(["straight", "circle"]),
        outcome=st.sampled_from(["done", "lost", "left_plate", "incomplete"]),
        timesteps=st.integers(0, 1000),
        **dict.fromkeys(NUMBERS, number),
    )
)
def test_a_row_survives_the_table_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, row: Row) -> None:
    folder = tmp_path_factory.mktemp("sweep")
    Table(folder, PLAN).add(row)
    (found,) = Table(folder, PLAN).rows.values()
    assert repr(found) == repr(row)


def test_a_table_of_before_there_were_paths_is_of_straight_ones(tmp_path: Path) -> None:
    rows = filled(tmp_path, count=2).rows
    names, *lines = (line.split(",") for line in (tmp_path / "runs.csv").read_text().splitlines())
    column = names.index("path")
    former = [cells[:column] + cells[column + 1 :] for cells in (names, *lines)]
    (tmp_path / "runs.csv").write_text("".join(",".join(cells) + "\n" for cells in former))
    assert Table(tmp_path, PLAN).rows == rows


def test_a_sweep_over_paths_has_every_path_with_every_seed() -> None:
    plan = Plan(("two",), ("plane",), ("previous",), (1, 2), SHORT, ("straight", "circle"))
    plan.check()
    assert [(task.seed, task.path) for task in plan.tasks()] == [
        (1, "straight"), (1, "circle"), (2, "straight"), (2, "circle"),
    ]  # fmt: skip
    assert sweep.build(Task("two", "plane", "previous", 1, "circle"), SHORT).leader.path == "circle"


def test_the_table_is_a_csv_file_with_the_names_of_the_quantities(tmp_path: Path) -> None:
    filled(tmp_path / "out")
    with (tmp_path / "out" / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [field.name for field in fields(Row)]
    assert [row["seed"] for row in rows] == ["1000", "1000", "1001", "1001"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["runs.csv", "sweep.json"]


def test_opening_a_table_again_keeps_it_byte_for_byte(tmp_path: Path) -> None:
    rows = dict(filled(tmp_path / "out").rows)
    before = lines_of(tmp_path / "out")
    assert Table(tmp_path / "out", PLAN).rows == rows
    assert lines_of(tmp_path / "out") == before


@pytest.mark.parametrize("kept", [1, 20, -12, -2, -1])
def test_a_last_line_that_was_cut_off_is_no_row_and_is_run_again(tmp_path: Path, kept: int) -> None:
    filled(tmp_path)
    before = lines_of(tmp_path)
    (tmp_path / "runs.csv").write_bytes(b"".join(before[:-1]) + before[-1][:kept])
    table = Table(tmp_path, PLAN)
    (missing,) = sweep.remaining(PLAN, table.rows)
    assert missing == list(PLAN.tasks())[-1]
    assert lines_of(tmp_path) == before[:-1]
    table.add(row_of(missing, 0.1 * 4 / 3.0))
    assert lines_of(tmp_path) == before


@pytest.mark.parametrize(
    "line",
    ["two,plane", "two,plane,previous,x" + ",1" * 11, "two,plane,previous,3,done,4,nan" + ",1" * 7, "\0", "a\rb"],
)
def test_a_damaged_line_is_named(tmp_path: Path, line: str) -> None:
    filled(tmp_path, count=2)
    with (tmp_path / "runs.csv").open("ab") as file:
        file.write(line.encode() + b"\r\n")
    with pytest.raises(SweepError, match=r"runs\.csv: line 4 can't be read; delete it"):
        Table(tmp_path, PLAN)


@pytest.mark.parametrize("content", [b"", b"name,value\n1,2\n", b"\xff\xfe\x00", b"track,surface"])
def test_another_file_in_the_tables_place_is_refused_and_kept(tmp_path: Path, content: bytes) -> None:
    filled(tmp_path)
    (tmp_path / "runs.csv").write_bytes(content)
    with pytest.raises(SweepError, match=r"runs\.csv: "):
        Table(tmp_path, PLAN)
    assert (tmp_path / "runs.csv").read_bytes() == content


def test_a_folder_with_something_else_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(SweepError, match="is not empty and holds no sweep; choose another folder"):
        Table(tmp_path, PLAN)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"settings": 5}', "\0"])
def test_a_damaged_record_of_a_sweep_is_refused(tmp_path: Path, content: str) -> None:
    filled(tmp_path)
    (tmp_path / "sweep.json").write_text(content)
    with pytest.raises(SweepError, match=r"sweep\.json: no record of a sweep"):
        Table(tmp_path, PLAN)


def test_a_sweep_with_other_settings_is_refused_and_kept(tmp_path: Path) -> None:
    filled(tmp_path)
    before = lines_of(tmp_path)
    other = replace(PLAN, settings=("leader.timesteps=5",))
    with pytest.raises(SweepError, match=r"other settings.*leader\.timesteps=4.*choose another folder"):
        Table(tmp_path, other)
    assert lines_of(tmp_path) == before
    assert json.loads((tmp_path / "sweep.json").read_text())["settings"] == list(SHORT)


def test_more_seeds_and_predictors_go_on_in_the_same_folder(tmp_path: Path) -> None:
    filled(tmp_path)
    wider = replace(PLAN, predictors=("ewma", "previous"), seeds=(1001, 1002))
    table = Table(tmp_path, wider)
    assert sweep.remaining(wider, table.rows) == [
        Task("two", "plane", "ewma", 1001),
        Task("two", "plane", "ewma", 1002),
        Task("two", "plane", "previous", 1002),
    ]
    assert [row.task for row in sweep.chosen(wider, table.rows)] == [Task("two", "plane", "previous", 1001)]


# --- runs -------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def one_job() -> dict[Task, Row]:
    return {row.task: row for row in sweep_runs.carry_out(PLAN.tasks(), SHORT, 1)}


def test_every_task_yields_its_row(one_job: dict[Task, Row]) -> None:
    assert set(one_job) == set(PLAN.tasks())
    for row in one_job.values():
        assert (row.outcome, row.timesteps, row.lost) == ("done", 4, False)
        assert all(type(getattr(row, name)) is float for name in NUMBERS)
    assert len({row.formation_error_rmse_m for row in one_job.values()}) == 4


@pytest.mark.long
def test_the_rows_do_not_depend_on_the_number_of_jobs_nor_on_the_order(one_job: dict[Task, Row]) -> None:
    tasks = list(PLAN.tasks())[::-1]
    two_jobs = {row.task: row for row in sweep_runs.carry_out(tasks, SHORT, 2)}
    assert {task: repr(row) for task, row in two_jobs.items()} == {task: repr(row) for task, row in one_job.items()}


def test_a_resumed_sweep_has_the_same_table_byte_for_byte_and_runs_only_what_is_missing(
    tmp_path: Path, one_job: dict[Task, Row]
) -> None:
    whole = Table(tmp_path / "whole", PLAN)
    for task in PLAN.tasks():
        whole.add(one_job[task])
    table = Table(tmp_path / "resumed", PLAN)
    for task in list(PLAN.tasks())[:2]:
        table.add(one_job[task])
    table = Table(tmp_path / "resumed", PLAN)
    missing = sweep.remaining(PLAN, table.rows)
    assert missing == list(PLAN.tasks())[2:]
    for row in sweep_runs.carry_out(missing, SHORT, 1):
        table.add(row)
    assert lines_of(tmp_path / "resumed") == lines_of(tmp_path / "whole")
    assert sweep.remaining(PLAN, table.rows) == []


def test_a_lost_run_is_a_row_too() -> None:
    row = sweep.run_task(Task("two", "plane", "previous", 1000), (*SHORT, "world.camera.pan_deg=-90"))
    assert (row.outcome, row.lost, row.timesteps, row.correction_m) == ("lost", True, 0, None)


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_run_that_stands_still_is_named(jobs: int) -> None:
    task = Task("two", "plane", "previous", 1000)
    words = "track two, surface plane, predictor previous, seed 1000: .*everybody waits"
    with pytest.raises(SweepError, match=words):
        list(sweep_runs.carry_out([task], (*SHORT, "world.lockstep=[leader,follower_1]"), jobs))
