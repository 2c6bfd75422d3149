"""The score of a predictor: how much less it leaves to correct than `previous`, over courses with seeds of their own.

A course is a leader's path on a surface. Each predictor drives each course with the same seeds. With C a course's
correction distance, summed over the seeds,

    score = mean over courses of 100 (1 - C / C_previous)     [%]

0 is no better than to repeat the last displacement, 100 is nothing left to correct. A seed that the predictor or
`previous` has lost counts for neither sum; in the ranking, fewer lost runs come first, then the higher score.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import asdict, dataclass

from robot_formation import plugins
from robot_formation.analysis.conditions import conditions
from robot_formation.analysis.sweep_summary import BASELINE
from robot_formation.batch.pool import run_parallel
from robot_formation.errors import FormationError
from robot_formation.experiment.sweep import Row, Task, build, run_to_row
from robot_formation.extras import require
from robot_formation.json_values import JsonObject
from robot_formation.koopman.predictors import NAMES, check_predictor_name
from robot_formation.koopman.predictors.parameters import CLOSE
from robot_formation.testing import check_predictor

REFERENCES = (BASELINE, "measured", "formation")
"""The predictors that every other one is set beside."""

_SEEDS = range(7_350_000, 7_350_005)
"""Used nowhere else, so that nothing was chosen by them."""


class ScoreError(FormationError):
    """A predictor can't be scored; the text says why."""


@dataclass(frozen=True)
class ScoredCourse:
    """A leader's path on a surface."""

    name: str
    surface: str
    path: str
    settings: tuple[str, ...] = ()


COURSES = (
    ScoredCourse("straight", "bowl", "straight"),
    ScoredCourse("pulse", "bowl", "pulse", ("leader.timesteps=30", "leader.path_parameters=[step_m=0.03]")),
    ScoredCourse("slalom", "saddle", "slalom", ("leader.timesteps=30", "leader.path_parameters=[step_m=0.03]")),
    ScoredCourse("circle", "plane", "circle", ("leader.timesteps=30",)),
    ScoredCourse("eight", "bowl", "lemniscate", ("leader.timesteps=30",)),
)
"""What is driven: the paper's track two, and four periodic paths."""


@dataclass(frozen=True)
class Standing:
    """What a predictor has reached.

    Attributes:
        rank: from 1.
        predictor: its name.
        runs: how many there were.
        lost: how many of them didn't come to their end.
        score: mean reduction of the correction distance against `previous` [%]; None if no course has a pair of runs.
        correction_m: of each course, mean correction distance of the finished runs; None if none was finished.
        formation_error_rmse_m: over all finished runs; None if none was finished.
    """

    rank: int
    predictor: str
    runs: int
    lost: int
    score: float | None
    correction_m: dict[str, float | None]
    formation_error_rmse_m: float | None


@dataclass(frozen=True)
class Ranking:
    """The standings, the best first, of a predictor among those that came before it.

    Attributes:
        predictor: which one was scored.
        standings: one for each predictor.
        seeds: how many seeds each course was driven with.
    """

    predictor: str
    standings: tuple[Standing, ...]
    seeds: int

    @property
    def own(self) -> Standing:
        """Where the scored predictor stands."""
        return next(standing for standing in self.standings if standing.predictor == self.predictor)

    def to_json(self) -> JsonObject:
        """Return all of it, and the conditions."""
        return {
            "predictor": self.predictor,
            "standings": [asdict(standing) for standing in self.standings],
            "seeds_per_course": self.seeds,
            "courses": [asdict(course) for course in COURSES],
            "conditions": _conditions(),
        }

    def __str__(self) -> str:
        """Write the table: lengths in centimetres."""
        return _table(self)


def check(name: str) -> None:
    """Check a predictor before anything is run; a class from outside the package by `testing.check_predictor`.

    Raises:
        FormationError: if there is none of this name, its class isn't what a predictor has to be, or what a run needs
            is not installed.
    """
    require("sim", "ros")
    check_predictor_name(name)
    if name not in NAMES:
        try:
            check_predictor(plugins.load("predictor", name.removesuffix(CLOSE)))
        except AssertionError as error:
            raise ScoreError(f"predictor '{name}': {error}") from None


def predictors(name: str) -> tuple[str, ...]:
    """Return who drives: those that came before, then this one."""
    return tuple(dict.fromkeys((*REFERENCES, name)))


def runs(name: str, *, quick: bool) -> list[tuple[Task, tuple[str, ...]]]:
    """List the runs with their settings."""
    return [
        (Task("two", course.surface, predictor, seed, course.path), course.settings)
        for course in COURSES
        for seed in _seeds(quick)
        for predictor in predictors(name)
    ]


def rows(name: str, *, quick: bool, jobs: int) -> Iterator[Row]:
    """Carry out the runs; yield what each has given as soon as it is there.

    Raises:
        FormationError: at the first run in which the class fails.
    """
    try:
        yield from run_parallel(run_to_row, runs(name, quick=quick), plugins.processes(jobs, [name]))
    except BrokenExecutor:
        raise ScoreError(f"a worker process died (by '{name}', or too little memory for --jobs {jobs}?)") from None


def judged(name: str, found: Sequence[Row]) -> Ranking:
    """Rank predictors by their runs.

    Args:
        name: which one is scored.
        found: a row for each of `runs`.
    """
    entries = [_standing(predictor, found) for predictor in predictors(name)]
    entries.sort(key=lambda entry: (entry.lost, math.inf if entry.score is None else -entry.score))
    ranked = [
        Standing(**{**vars(entry), "rank": 1 + sum(_before(other, entry) for other in entries)}) for entry in entries
    ]
    return Ranking(name, tuple(ranked), len({row.seed for row in found}))


def _before(one: Standing, other: Standing) -> bool:
    """Whether one ranks before another one; equal ones share a rank."""
    if one.lost != other.lost:
        return one.lost < other.lost
    return one.score is not None and (other.score is None or one.score > other.score)


def _standing(predictor: str, found: Sequence[Row]) -> Standing:
    own = [row for row in found if row.predictor == predictor]
    finished = [row for row in own if not row.lost]
    corrections = {
        course.name: _mean([row.correction_m for row in finished if row.path == course.path]) for course in COURSES
    }
    reductions = [reduction for course in COURSES if (reduction := _reduction(course, predictor, found)) is not None]
    errors_m = [row.formation_error_rmse_m for row in finished]
    rmse_m = _mean([None if error_m is None else error_m**2 for error_m in errors_m])
    return Standing(
        rank=0,
        predictor=predictor,
        runs=len(own),
        lost=len(own) - len(finished),
        score=_mean(reductions),
        correction_m=corrections,
        formation_error_rmse_m=None if rmse_m is None else math.sqrt(rmse_m),
    )


def _reduction(course: ScoredCourse, predictor: str, found: Sequence[Row]) -> float | None:
    """Return 100 (1 - C / C_previous) [%] over the seeds that both have finished; None where it isn't defined."""
    finished = {
        (row.predictor, row.seed): row.correction_m
        for row in found
        if row.path == course.path and not row.lost and row.correction_m is not None
    }
    seeds = [seed for name, seed in finished if name == predictor and (BASELINE, seed) in finished]
    own_m = sum(finished[predictor, seed] for seed in seeds)
    baseline_m = sum(finished[BASELINE, seed] for seed in seeds)
    return 100.0 * (1.0 - own_m / baseline_m) if baseline_m > 0.0 else None


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _seeds(quick: bool) -> range:
    return _SEEDS[:1] if quick else _SEEDS


def _conditions() -> JsonObject:
    scenario = build(Task("two", "bowl", BASELINE, 0), ())
    return {**conditions(scenario.by_node(), [place.uv_m for place in scenario.slots]), "in_process": True}


def _table(found: Ranking) -> str:
    width = max(len(standing.predictor) for standing in found.standings) + 2
    courses = "".join(f"{course.name:>10}" for course in COURSES)
    lines = [
        f"{'':4}  {'':<{width}}{'score':>7}  {'lost':>9}{'formation':>12}   correction distance (cm)",
        f"{'rank':>4}  {'predictor':<{width}}{'(%)':>7}  {'of ' + str(found.own.runs):>9}{'error (cm)':>12}{courses}",
        "-" * (4 + 2 + width + 7 + 2 + 9 + 12 + 10 * len(COURSES)),
    ]
    for standing in found.standings:
        corrections = "".join(f"{_cell(standing.correction_m[course.name], 100.0):>10}" for course in COURSES)
        marked = f"{standing.predictor}{' *' if standing.predictor == found.predictor else ''}"
        lines.append(
            f"{standing.rank:>4}  {marked:<{width}}{_cell(standing.score):>7}  {standing.lost:>9}"
            f"{_cell(standing.formation_error_rmse_m, 100.0, 2):>12}{corrections}"
        )
    return "\n".join(lines)


def _cell(value: float | None, scale: float = 1.0, digits: int = 1) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f}"
