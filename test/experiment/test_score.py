"""The score: who ranks where, from runs that are made up."""

from collections.abc import Callable

import pytest

from robot_formation.experiment import score
from robot_formation.experiment.sweep import Row, Task


def rows(correction_m: Callable[[Task], float], lost: Callable[[Task], bool] = lambda task: False) -> list[Row]:
    """A row for each run of the predictor 'ewma'; the RMSE of the formation error is 1 cm."""
    return [
        Row(*task, "lost" if lost(task) else "done", 30, correction_m(task), *[0.01] * 7)
        for task, _ in score.runs("ewma", quick=False)
    ]


def by_predictor(values: dict[str, float]) -> Callable[[Task], float]:
    return lambda task: values[task.predictor]


VALUES = {"previous": 0.2, "measured": 0.3, "formation": 0.0, "ewma": 0.1}


def test_the_score_is_the_mean_reduction_against_previous_and_the_highest_ranks_first() -> None:
    found = score.judged("ewma", rows(by_predictor(VALUES)))
    assert [entry.predictor for entry in found.standings] == ["formation", "ewma", "previous", "measured"]
    assert [entry.rank for entry in found.standings] == [1, 2, 3, 4]
    assert [entry.score for entry in found.standings] == pytest.approx([100.0, 50.0, 0.0, -50.0])
    assert found.own.correction_m == {course.name: pytest.approx(0.1) for course in score.COURSES}
    assert found.own.formation_error_rmse_m == pytest.approx(0.01)
    assert (found.own.runs, found.own.lost, found.seeds) == (25, 0, 5)


def test_every_course_weighs_the_same_however_much_there_is_to_correct() -> None:
    def correction_m(task: Task) -> float:
        return VALUES[task.predictor] * (100.0 if task.path == "circle" and task.predictor != "formation" else 1.0)

    assert score.judged("ewma", rows(correction_m)).own.score == pytest.approx(50.0)


def test_who_loses_a_run_ranks_below_all_who_lose_none_and_the_run_counts_for_no_sum() -> None:
    def lost(task: Task) -> bool:
        return task.predictor == "formation" and task.path == "slalom" and task.seed % 5 == 0

    found = score.judged("ewma", rows(by_predictor(VALUES), lost))
    assert [entry.predictor for entry in found.standings] == ["ewma", "previous", "measured", "formation"]
    assert found.standings[-1].lost == 1
    assert found.standings[-1].score == pytest.approx(100.0)


def test_equal_ones_share_a_rank() -> None:
    found = score.judged("ewma", rows(by_predictor({**VALUES, "ewma": 0.2})))
    assert {entry.predictor: entry.rank for entry in found.standings} == {
        "formation": 1,
        "previous": 2,
        "ewma": 2,
        "measured": 4,
    }


def test_without_a_finished_run_there_is_no_score() -> None:
    found = score.judged("ewma", rows(by_predictor(VALUES), lambda task: task.predictor == "ewma"))
    assert (found.own.rank, found.own.score, found.own.formation_error_rmse_m) == (4, None, None)
    assert set(found.own.correction_m.values()) == {None}
    assert str(found).splitlines()[-1].split()[:5] == ["4", "ewma", "*", "-", "25"]


def test_a_predictor_that_came_before_stands_in_the_table_once() -> None:
    assert score.predictors("measured") == ("previous", "measured", "formation")
    assert len(score.runs("measured", quick=True)) == 15
    assert len(score.runs("ewma", quick=False)) == 100


def test_the_runs_of_a_seed_are_the_same_for_all_predictors() -> None:
    courses: dict[str, set[object]] = {}
    for task, settings in score.runs("ewma", quick=False):
        courses.setdefault(task.predictor, set()).add((task._replace(predictor=""), settings))
    assert len({frozenset(found) for found in courses.values()}) == 1
