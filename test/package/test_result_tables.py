"""The tables of results in the README and on pages are what the stored runs say."""

import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blackouts
import leader_path_runs
import leader_path_tables
import make_result_tables
import marked_text
import sensitivity
from robot_formation.errors import FormationError
from robot_formation.experiment import sweep


@pytest.mark.parametrize("table", make_result_tables.TABLES, ids=lambda table: table.name)
def test_a_table_of_results_is_up_to_date(table: make_result_tables.Table) -> None:
    before, after = make_result_tables.updated(table)
    assert before == after, "run python docs/make_result_tables.py"


def test_the_readmes_median_is_that_of_the_stored_runs() -> None:
    """An oracle of its own: NumPy on the plain table."""
    rows = [row for row in make_result_tables.track_rows() if (row.track, row.predictor) == ("two", "measured")]
    median_cm = 100.0 * float(np.median([row.correction_m or 0.0 for row in rows]))
    line = next(line for line in make_result_tables.readme_lines() if line.startswith("| two | `measured` |"))
    assert f"| {median_cm:.1f} (" in line


def test_the_paired_reduction_is_that_of_the_stored_runs() -> None:
    corrections: dict[str, dict[int, float]] = {}
    for row in make_result_tables.track_rows():
        if row.track == "two":
            corrections.setdefault(row.predictor, {})[row.seed] = row.correction_m or 0.0
    pairs = [1.0 - corrections["measured"][seed] / corrections["previous"][seed] for seed in corrections["measured"]]
    line = next(line for line in make_result_tables.readme_lines() if line.startswith("| two | `measured` |"))
    assert f"| {100.0 * float(np.median(pairs)):.0f} (" in line


def test_stored_runs_are_of_todays_scenarios() -> None:
    """What the stored sweep was made with can be planned today."""
    plan, rows = sweep.read_sweep(make_result_tables.DATA / "tracks")
    plan.check()
    assert len(rows) == len(list(plan.tasks()))


def test_a_page_without_a_place_for_the_table_is_named(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("no marks\n")
    with pytest.raises(FormationError, match=r"page\.md needs <!-- x -->"):
        marked_text.with_marked(page, "x", "text")


@pytest.mark.parametrize("level", sensitivity.LEVELS)
def test_every_level_of_the_study_is_a_scenario(level: str) -> None:
    sweep.build(
        sensitivity.sweep_task(sensitivity.Task(level, "measured", 0)), sensitivity.LEVELS[level].settings
    ).check()


def test_levels_differ_from_the_defaults_and_from_each_other() -> None:
    built = {
        name: sweep.build(sensitivity.sweep_task(sensitivity.Task(name, "measured", 0)), level.settings)
        for name, level in sensitivity.LEVELS.items()
    }
    assert len({repr(scenario) for scenario in built.values()}) == len(built)


def test_a_lost_run_ranks_worst_in_the_study() -> None:
    def row(predictor: str, seed: int, correction_m: float, outcome: str = "done") -> sensitivity.Row:
        return sensitivity.Row("plane", predictor, seed, outcome, correction_m, 0.0, 0.0, 1.0, 0.01, 0.0, None)

    rows = [row("previous", seed, 0.2) for seed in range(3)]
    rows += [row("measured", 0, 0.1), row("measured", 1, 0.1, "leader_lost"), row("measured", 2, 0.1, "leader_lost")]
    (line,) = sensitivity.table_lines(rows)[2:]
    assert "| lost (" in line
    assert "`measured` 2" in line
    rows[-1] = row("measured", 2, 0.1)
    assert "| 50 (" in sensitivity.table_lines(rows)[2]


def test_the_figure_of_the_study_is_drawn(tmp_path: Path) -> None:
    rows = [
        sensitivity.Row(level, predictor, seed, "done", 0.1 + 0.01 * seed, 0.0, 0.0, 1.0, 0.01, 0.0, None)
        for level in ("default", "plane")
        for predictor in sensitivity.PREDICTORS
        for seed in range(5)
    ]
    sensitivity.draw(rows, tmp_path / "study.png")
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")


def path_row(surface: str, predictor: str, seed: int, correction_m: float, outcome: str = "done") -> Any:
    return leader_path_runs.Row("circle12", surface, predictor, seed, outcome, 60, correction_m, *[None] * 14)


def test_leader_paths_are_compared_with_the_best_of_the_other_models_on_the_bowl() -> None:
    rows = []
    for name, correction_m in zip((*leader_path_tables.OTHERS, "formation"), (3.0, 2.0, 1.0, 0.5, 0.1), strict=True):
        rows += [path_row("bowl", name, seed, correction_m) for seed in range(3)]
        rows += [path_row("plane", name, seed, 0.3) for seed in range(3)]
    (line,) = leader_path_tables.surface_lines(rows, "bowl")[2:]
    assert line == (
        "| circle12 | 3 | 0 | 300.0 | 200.0 | 100.0 | 50.0 | 10.0 (10.0..10.0) "
        "| 0.05 (0.05..0.05) | 0.10 (0.10..0.10) | 0.20 (0.20..0.20) |"
    )
    rows.append(path_row("bowl", "formation", 3, 0.1, "leader_lost"))
    assert "| 4 (3) | `formation` 1 |" in leader_path_tables.surface_lines(rows, "bowl")[2]


def test_phases_of_the_run_show_the_baseline_beside_formation() -> None:
    rows = [path_row("bowl", name, 0, 0.1) for name in leader_path_tables.COMPARED]
    rows = [
        replace(row, correction_5_10_m=0.02 * (1 + i), prediction_rmse_31_m=0.01 * (1 + i), coverage_3=0.5)
        for i, row in enumerate(rows)
    ]
    (line,) = leader_path_tables.phase_lines(rows, "bowl")[2:]
    assert line == (
        "| circle12 | 2.0 / 4.0 | - / - | - / - | - / - | - / - | 1.0 / 2.0 | - / - | - / 50 / - | 0 of 1 |"
    )


def test_growths_over_a_blackout_are_paired_over_seeds() -> None:
    def row(predictor: str, seed: int, growth_m: float | None) -> blackouts.Row:
        return blackouts.Row("circle12", "bowl", predictor, seed, "done", 46, 0.01, 0.02, 0.03, 0.05, growth_m, 1)

    rows = [row("previous+close", seed, 0.1) for seed in range(3)]
    rows += [row("formation", seed, growth_m) for seed, growth_m in enumerate((0.01, 0.02, 0.03))]
    (line,) = blackouts.page_lines(rows)[2:]
    assert line.startswith(
        "| circle12 | 3 | 1.0 / 1.0 | 2.0 / 2.0 | 3.0 / 3.0 | 5.0 / 5.0 | 10.0 / 2.0 | 0.20 (0.10..0.30) |"
    )
    rows[0] = row("previous+close", 0, None)  # lost before: infinitely worse
    assert " 0.20 (0.00..0.30) " in blackouts.page_lines(rows)[2]
    assert blackouts.ratio(None, 0.1) == float("inf")


def test_data_that_cannot_be_read_are_told_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(make_result_tables, "DATA", tmp_path)
    monkeypatch.setattr(sys, "argv", ["make_result_tables.py", "--check"])
    assert make_result_tables.main() == 2
    assert "no record of a sweep" in capsys.readouterr().err


def test_a_level_counts_once_and_jobs_are_at_least_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run_parallel(function: object, arguments: Iterable[tuple[sensitivity.Task]], jobs: int) -> Iterator[object]:
        return (sensitivity.Row(*task, "done", *[0.1] * 7) for (task,) in arguments)

    monkeypatch.setattr(sensitivity, "run_parallel", run_parallel)
    command = ["sensitivity.py", "run", str(tmp_path), "--seeds", "0", "--levels", "default,default"]
    monkeypatch.setattr(sys, "argv", [*command, "--predictors", "measured,measured", "--jobs", "1"])
    assert sensitivity.main() == 0
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 1 + 1
    monkeypatch.setattr(sys, "argv", [*command, "--jobs", "0"])
    with pytest.raises(SystemExit, match="2"):
        sensitivity.main()
    assert "argument --jobs: '0' is not a whole number above zero" in capsys.readouterr().err
