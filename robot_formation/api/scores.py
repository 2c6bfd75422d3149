"""Scores: a predictor of one's own beside those that came before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from robot_formation.api.inputs import whole_number
from robot_formation.batch.progress_line import with_progress
from robot_formation.errors import FormationError, shown
from robot_formation.experiment import score as scores
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Score:
    """Where a predictor stands among others. `score` makes one.

    Attributes:
        ranking: the standings as the package itself handles them; not part of the documented interface.
    """

    ranking: scores.Ranking

    @property
    def value(self) -> float | None:
        """Mean reduction of the correction distance against `previous` [%]; None if no run came to its end."""
        return self.ranking.own.score

    @property
    def rank(self) -> int:
        """The predictor's rank, from 1."""
        return self.ranking.own.rank

    def summary(self) -> str:
        """Return the table that `formation score` prints: centimetres."""
        return str(self.ranking)

    def report(self) -> JsonObject:
        """Return what `formation score --json` prints, as a dictionary."""
        return self.ranking.to_json()

    def to_pandas(self) -> pd.DataFrame:
        """Return a table with a row per predictor, the best first; correction distances by course, in metres.

        Raises:
            FormationError: pandas is not installed.
        """
        from robot_formation.api.tables import table

        rows = []
        for standing in self.ranking.standings:
            row = dict(vars(standing))
            corrections = row.pop("correction_m")
            rows.append({**row, **{f"{course}_correction_m": value for course, value in corrections.items()}})
        return table(rows, ())

    def __repr__(self) -> str:
        """Return the essentials in a line."""
        own = self.ranking.own
        said = "no score" if own.score is None else f"{own.score:.1f} %"
        return (
            f"<Score of {own.predictor!r}: {said}, rank {own.rank} of {len(self.ranking.standings)}, {own.lost} lost>"
        )


def score(predictor: str | type, *, quick: bool = False, jobs: int = 1, progress: bool = False) -> Score:
    """Drive five courses with a predictor, and with `previous`, `measured` and `formation`, as `formation score` does.

    Args:
        predictor: a name of `predictors()`, `module:Class`, or the class.
        quick: one seed for each course instead of five.
        jobs: how many runs at the same time, each in a process of its own; those of a class of the running script or
            notebook are always made in this one.
        progress: whether to print to standard error how far it is.

    Raises:
        FormationError: there is no such predictor, its class is not what a predictor has to be or fails, or something
            that a run needs is not installed.
    """
    name = _name(predictor)
    jobs = whole_number("jobs", jobs, 1)
    scores.check(name)
    count = len(scores.runs(name, quick=quick))
    rows = scores.rows(name, quick=quick, jobs=min(jobs, count))
    return Score(scores.judged(name, list(with_progress(rows, count) if progress else rows)))


def _name(predictor: object) -> str:
    """Return a predictor's name, or that of its class.

    Raises:
        FormationError: it is neither, or a class that can't be found by its name.
    """
    if isinstance(predictor, str):
        return predictor
    if not isinstance(predictor, type):
        raise FormationError(f"predictor is a name, 'module:Class', or a class, not {shown(predictor)}")
    if "." in predictor.__qualname__:
        raise FormationError(
            f"predictor {predictor.__qualname__} can't be found by its name; define the class outside of functions "
            "and classes"
        )
    return f"{predictor.__module__}:{predictor.__qualname__}"
