"""`rf.score`: the same ranking as the command line's, for names and classes."""

import json
import sys
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pytest

import robot_formation as rf
from robot_formation.experiment import score as scores
from robot_formation.experiment.sweep import Row, Task


class Last:
    """What `previous` is."""

    def observe(self, displacement: Any) -> None:
        self.last = displacement.copy()

    def forecast(self) -> Any:
        return self.last


def local_class() -> type:
    class Inner(Last):
        pass

    return Inner


@pytest.fixture
def jobs_of(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many jobs were asked for; runs are made up, and 'formation' leaves half of what the others leave."""
    asked: list[int] = []

    def run_parallel(function: Any, arguments: Iterable[tuple[Task, Any]], jobs: int) -> Iterator[Row]:
        asked.append(jobs)
        for task, _ in arguments:
            yield Row(*task, "done", 30, 0.1 if task.predictor == "formation" else 0.2, *[0.01] * 7)

    monkeypatch.setattr(scores, "run_parallel", run_parallel)
    return asked


def test_a_class_of_a_notebook_is_scored_in_this_process(monkeypatch: pytest.MonkeyPatch, jobs_of: list[int]) -> None:
    monkeypatch.setattr(sys.modules["__main__"], "Last", Last, raising=False)
    monkeypatch.setattr(Last, "__module__", "__main__")
    found = rf.score(Last, quick=True, jobs=4)
    assert jobs_of == [1]
    assert (found.value, found.rank) == (0.0, 2)
    assert repr(found) == "<Score of '__main__:Last': 0.0 %, rank 2 of 4, 0 lost>"
    assert "__main__:Last *" in found.summary()


def test_a_score_is_a_table_and_json(jobs_of: list[int]) -> None:
    found = rf.score("formation", jobs=2)
    assert jobs_of == [2]
    assert found.value == pytest.approx(50.0)
    report = json.loads(json.dumps(found.report()))
    assert [entry["predictor"] for entry in report["standings"]] == ["formation", "previous", "measured"]
    pytest.importorskip("pandas")
    table = found.to_pandas()
    assert table["predictor"].tolist() == ["formation", "previous", "measured"]
    assert np.allclose(table["circle_correction_m"], [0.1, 0.2, 0.2])
    assert table["runs"].tolist() == [25, 25, 25]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("formaton",), "'formation'"),
        ((dict,), "no method 'observe'"),
        (("nobody:Mine",), "no module 'nobody'"),
        ((Last(),), "a name, 'module:Class', or a class, not <"),
        ((None,), "or a class, not None"),
        ((3,), "or a class, not 3"),
        ((local_class(),), "define the class outside of functions"),
    ],
)
def test_what_is_no_predictor_is_refused_before_anything_is_run(jobs_of: list[int], arguments: Any, words: str) -> None:
    with pytest.raises(rf.FormationError, match=words):
        rf.score(*arguments)
    assert jobs_of == []


@pytest.mark.parametrize("jobs", [0, -1, 1.5, True])
def test_a_wrong_number_of_jobs_is_refused(jobs_of: list[int], jobs: Any) -> None:
    with pytest.raises(rf.FormationError, match="jobs is a whole number from 1 on"):
        rf.score("formation", jobs=jobs)
    assert jobs_of == []
