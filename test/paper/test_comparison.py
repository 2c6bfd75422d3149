"""Numbers beside the paper's: agreement, differences, reductions, and how they are written."""

import math

import pytest

from robot_formation.experiment.sweep import Row
from robot_formation.paper.comparison import Comparison, Ours, reduction
from robot_formation.paper.index_page import number_text, ours_text
from robot_formation.paper.statements import FIGURES, Statement
from robot_formation.paper.work import WorkProgress

STATED = Statement("x", "a length", 10.0, "cm", "caption", within=0.5)


def row(predictor: str, seed: int, correction_m: float | None, outcome: str = "done", track: str = "two") -> Row:
    return Row(track, "bowl", predictor, seed, "straight", outcome, 20, correction_m, *[None] * 7)


@pytest.mark.parametrize(
    ("ours", "agrees"),
    [
        (Ours(10.5), True),
        (Ours(10.6), False),
        (Ours(12.0, 9.0, 15.0), True),
        (Ours(12.0, 11.0, 15.0), False),
        (Ours(None), None),
        (Ours(3.0, below=True), True),
        (Ours(10.1, below=True), False),
    ],
)
def test_agreement(ours: Ours, agrees: bool | None) -> None:
    assert Comparison(STATED, ours).agrees is agrees


def test_differences_have_the_unit_and_reasons_belong_to_differences_only() -> None:
    differs = Comparison(STATED, Ours(12.0, reason="because")).to_json()
    assert (differs["difference"], differs["reason"]) == (2.0, "because")
    assert Comparison(STATED, Ours(10.0, reason="because")).to_json()["reason"] is None


def test_the_reduction_is_the_paired_median_and_a_lost_run_ranks_worst() -> None:
    rows = [row("previous", seed, 0.10) for seed in range(5)]
    rows += [row("measured", seed, 0.10 - 0.02 * seed) for seed in range(4)]
    rows += [row("measured", 4, 0.01, outcome="lost")]
    found = reduction(rows, "two", "two", "measured")
    assert found.value == pytest.approx(20.0)  # of 0, 20, 40, 60 and one lost
    assert found.low is None  # the interval reaches to the lost run
    assert found.high == pytest.approx(60.0)
    own = reduction([*rows, *(row("previous", s, 0.2, track="two_baseline") for s in range(5))],
                    "two", "two_baseline", "measured")  # fmt: skip
    assert own.value == pytest.approx(60.0)
    assert reduction([], "two", "two", "measured").value is None


def test_keys_and_names_are_unique() -> None:
    keys = [stated.key for figure in FIGURES for stated in figure.statements]
    assert len(set(keys)) == len(keys)
    assert len({figure.name for figure in FIGURES}) == len(FIGURES)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(15, "", "15"), (208.4, "mm", "208.4 mm"), (1.333, "cm", "1.33 cm"), (-1e-9, "cm", "0 cm"), (50.0, "px", "50 px")],
)
def test_numbers_are_short(value: float, unit: str, text: str) -> None:
    assert number_text(value, unit) == text


def test_intervals_are_written_and_an_unknown_value_is_said() -> None:
    assert ours_text(Ours(-14.0, -20.0, -7.0), "%") == "-14 % (-20 to -7)"
    assert ours_text(Ours(None), "%") == "unknown"


def test_progress_tells_share_and_time_left() -> None:
    said: list[str] = []
    progress = WorkProgress(10.0, said.append, every_s=0.0)
    progress.add(2.5, "motors")
    progress.add(7.5, "runs")
    assert said[0].startswith("25 %  motors, about 0:0")
    assert said[1].startswith("99 %  runs, about 0:00 left")
    assert math.isclose(float(said[0].split()[0]), 25.0)
