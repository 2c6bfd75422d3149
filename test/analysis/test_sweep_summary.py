"""The summary of a sweep against independent computations."""

import json
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.analysis import markdown
from robot_formation.analysis.sweep_summary import MEDIANS, median_with_interval, summarise, table


@dataclass
class Run:
    """A run with the same figure in every column unless told otherwise."""

    predictor: str
    seed: int
    correction_m: float | None = 0.1
    lost: bool = False
    track: str = "two"
    surface: str = "bowl"
    prediction_coverage_90: float | None = 0.9
    correction_u_m: float | None = 0.02
    correction_v_m: float | None = 0.08
    movements_per_timestep: float | None = 1.5
    formation_error_rmse_m: float | None = 0.01
    heading_error_rmse_rad: float | None = 0.03
    path: ClassVar[str] = "straight"


def runs_of(predictor: str, corrections: Sequence[float | None], **others: Any) -> list[Run]:
    return [Run(predictor, seed, value, **others) for seed, value in enumerate(corrections)]


def entry_of(
    rows: Sequence[Run], predictor: str = "formation", track: str = "two", surface: str = "bowl"
) -> dict[str, Any]:
    (entry,) = [e for e in summarise(rows) if (e["track"], e["surface"], e["predictor"]) == (track, surface, predictor)]
    return entry


def interval_of(values: Sequence[float]) -> dict[str, Any]:
    """The median and the ends of its interval; there is one."""
    found = median_with_interval(values)
    assert found is not None
    return found


finite = st.floats(0.0, 10.0, allow_nan=False)
corrections = st.one_of(st.none(), st.just(0.0), finite)

# --- medians and intervals --------------------------------------------------------------------------------------------


@given(st.lists(st.floats(-1e6, 1e6, allow_subnormal=False), min_size=1, max_size=40))
def test_the_median_is_that_of_the_standard_library_and_lies_in_its_interval(values: list[float]) -> None:
    found = interval_of(values)
    assert found["median"] == pytest.approx(statistics.median(values), rel=1e-12, abs=1e-12)
    assert min(values) <= found["low"] <= found["median"] <= found["high"] <= max(values)
    assert interval_of(values[::-1]) == found


def _more_than_half(draws: int, probability: float) -> float:
    """Probability that more than half of the draws hit."""
    return math.fsum(
        math.comb(draws, hits) * probability**hits * (1.0 - probability) ** (draws - hits)
        for hits in range(draws // 2 + 1, draws + 1)
    )


@pytest.mark.parametrize("count", [5, 21, 51, 201])
def test_interval_ends_are_quantiles_of_the_bootstraps_exact_distribution(count: int) -> None:
    # Of an odd number, a resample's median is at most the k-th value if most of its draws are among the first k.
    data = np.sort(np.random.default_rng(count).gamma(2.0, 0.1, count))
    below = [_more_than_half(count, k / count) for k in range(1, count + 1)]
    found = interval_of(data.tolist())
    for end, share in ((found["low"], 0.025), (found["high"], 0.975)):
        position = data.tolist().index(end)
        before = below[position - 1] if position else 0.0
        # 2000 resamples tell a share of 2.5 % to 1.5 % at four standard deviations.
        assert before - 0.015 <= share <= below[position] + 0.015


def test_the_interval_is_that_of_another_bootstrap() -> None:
    data = np.random.default_rng(4).normal(1.0, 0.2, 100)
    found = interval_of(data.tolist())
    medians = np.median(np.random.default_rng(1).choice(data, (4000, len(data))), axis=1)
    assert [found["low"], found["high"]] == pytest.approx(np.quantile(medians, [0.025, 0.975]), abs=0.01)


def test_one_value_is_its_own_interval_and_none_has_none() -> None:
    assert median_with_interval([0.3]) == {"median": 0.3, "low": 0.3, "high": 0.3}
    assert median_with_interval([]) is None


def test_a_median_between_a_number_and_a_lost_run_is_worse_than_any_number() -> None:
    assert interval_of([1.0, math.inf])["median"] is None
    assert interval_of([1.0, 2.0, math.inf])["median"] == 2.0
    assert interval_of([1.0, -math.inf])["median"] is None
    assert median_with_interval([math.inf] * 3) == dict.fromkeys(("median", "low", "high"))


# --- groups -----------------------------------------------------------------------------------------------------------


def test_each_quantity_has_its_own_median() -> None:
    rows = [
        Run(
            "previous", seed, 0.1 * seed, False, "two", "bowl", 0.8 + 0.1 * (seed % 2), *(k * seed for k in range(1, 6))
        )
        for seed in range(4)
    ]
    entry = entry_of(rows, "previous")
    assert (entry["runs"], entry["lost"], entry["lost_rate"]) == (4, 0, 0.0)
    expected = dict(zip(MEDIANS, (0.15, 1.5, 3.0, 4.5, 6.0, 7.5), strict=True))
    assert {name: entry[name]["median"] for name in MEDIANS} == pytest.approx(expected)
    assert entry["prediction_coverage_90"] == pytest.approx(0.85)


def test_groups_come_in_order_of_appearance_and_know_nothing_of_each_other() -> None:
    rows = [
        *runs_of("previous", [0.4, 0.4]),
        *runs_of("formation", [0.1, 0.1]),
        *runs_of("formation", [0.3, 0.3], track="one"),
        *runs_of("previous", [0.6, 0.6], surface="ripple"),
    ]
    found = summarise(rows)
    assert [(e["track"], e["surface"], e["predictor"]) for e in found] == [
        ("two", "bowl", "previous"),
        ("two", "bowl", "formation"),
        ("one", "bowl", "formation"),
        ("two", "ripple", "previous"),
    ]
    assert found[1]["reduction"]["median"] == pytest.approx(0.75)
    assert found[1]["ratio_to"]["previous"]["median"] == pytest.approx(0.25)
    assert found[2]["reduction"] is None
    assert found[2]["ratio_to"] == {}
    assert summarise([]) == []


def test_a_quantity_that_no_run_has_is_none_and_one_that_some_have_is_of_these() -> None:
    rows = [Run("previous", seed, formation_error_rmse_m=None, heading_error_rmse_rad=None) for seed in range(3)]
    rows[1].heading_error_rmse_rad = 0.2
    for row in rows:
        row.prediction_coverage_90 = None
    entry = entry_of(rows, "previous")
    assert entry["formation_error_rmse_m"] is None
    assert entry["heading_error_rmse_rad"]["median"] == 0.2
    assert entry["prediction_coverage_90"] is None
    assert "-" in table([entry])


# --- pairs ------------------------------------------------------------------------------------------------------------


def test_the_reduction_is_the_median_of_pairs_not_the_ratio_of_medians() -> None:
    previous, own = [1.0, 2.0, 8.0], [0.5, 0.2, 0.8]
    entry = entry_of([*runs_of("previous", previous), *runs_of("formation", own)])
    assert entry["reduction"]["median"] == pytest.approx(statistics.median([0.5, 0.9, 0.9]))
    assert 1.0 - statistics.median(own) / statistics.median(previous) == pytest.approx(0.75)


def test_runs_are_paired_by_seed_whatever_their_order_and_those_without_a_partner_are_left_out() -> None:
    rows = [
        Run("formation", 5, 0.1),
        Run("formation", 3, 0.3),
        Run("formation", 9, 99.0),
        Run("previous", 3, 0.6),
        Run("previous", 7, 1e-6),
        Run("previous", 5, 1.0),
    ]
    entry = entry_of(rows)
    assert entry["reduction"]["median"] == pytest.approx((0.9 + 0.5) / 2.0)
    assert entry["runs"] == 3
    assert entry["correction_m"]["median"] == 0.3
    assert entry_of(rows, "previous")["ratio_to"]["formation"]["median"] == pytest.approx((10.0 + 2.0) / 2.0)
    alone = entry_of([Run("formation", 1), Run("previous", 2)])
    assert alone["reduction"] is None
    assert alone["ratio_to"] == {"previous": None}


def test_the_same_run_twice_counts_once() -> None:
    entry = entry_of([Run("formation", 1, 0.1), Run("formation", 1, 0.1), Run("previous", 1, 0.2)])
    assert entry["runs"] == 1


@given(st.lists(st.tuples(finite, finite.filter(bool), st.booleans(), st.booleans()), min_size=1, max_size=25))
def test_reduction_and_ratio_against_a_plain_computation(pairs: list[tuple[float, float, bool, bool]]) -> None:
    rows, ratios = [], []
    for seed, (own, other, own_lost, other_lost) in enumerate(pairs):
        rows += [Run("formation", seed, own, own_lost), Run("previous", seed, other, other_lost)]
        ratios.append(math.inf if own_lost else 0.0 if other_lost else own / other)
    expected = sorted(ratios)[(len(ratios) - 1) // 2 : len(ratios) // 2 + 1]
    entry = entry_of(rows)
    ratio, reduction = entry["ratio_to"]["previous"]["median"], entry["reduction"]["median"]
    if math.isinf(max(expected)):
        assert ratio is None
        assert reduction is None
    else:
        assert ratio == pytest.approx(statistics.fmean(expected))
        assert reduction == pytest.approx(1.0 - statistics.fmean(expected))


# --- lost runs and zeros ----------------------------------------------------------------------------------------------


def test_lost_runs_rank_worst_in_every_median_however_small_their_figures() -> None:
    rows = [Run("previous", seed, 0.1 * (seed + 1)) for seed in range(5)]
    for row in rows[:2]:
        row.lost, row.correction_m, row.formation_error_rmse_m = True, 0.0, None
    entry = entry_of(rows, "previous")
    assert (entry["lost"], entry["lost_rate"]) == (2, 0.4)
    assert entry["correction_m"]["median"] == pytest.approx(0.5)  # of 0.3, 0.4, 0.5, lost, lost
    assert entry["formation_error_rmse_m"]["median"] == 0.01
    assert entry["correction_m"]["high"] is None
    rows[2].lost = True
    entry = entry_of(rows, "previous")
    assert all(entry[name]["median"] is None for name in MEDIANS)
    assert "lost (" in table([entry])


def test_a_lost_run_is_the_worst_of_pairs_and_wins_against_nothing() -> None:
    lost = Run("formation", 0, None, lost=True)
    assert entry_of([lost, Run("previous", 0, 0.1)])["reduction"]["median"] is None
    assert entry_of([lost, Run("previous", 0, None, lost=True)])["reduction"]["median"] is None
    beaten = entry_of([Run("formation", 0, 0.1), Run("previous", 0, None, lost=True)])
    assert beaten["reduction"]["median"] == 1.0
    assert beaten["ratio_to"]["previous"]["median"] == 0.0


def test_no_correction_of_previous_divides_by_nothing() -> None:
    rows = [*runs_of("previous", [0.0, 0.0, 0.0]), *runs_of("formation", [0.0, 0.0, 0.0])]
    assert entry_of(rows)["reduction"] == {"median": 0.0, "low": 0.0, "high": 0.0}
    worse = [*runs_of("previous", [0.0, 0.0, 0.0]), *runs_of("formation", [0.1, 0.1, 0.1])]
    assert entry_of(worse)["reduction"]["median"] is None
    assert entry_of(worse, "previous")["ratio_to"]["formation"]["median"] == 0.0


def test_runs_that_ended_before_any_correction_counts_are_no_pairs_and_not_lost() -> None:
    rows = [*runs_of("previous", [None, 0.2]), *runs_of("formation", [None, 0.1])]
    assert entry_of(rows)["reduction"]["median"] == pytest.approx(0.5)
    short = [*runs_of("previous", [None, None]), *runs_of("formation", [None, None])]
    assert entry_of(short)["reduction"] is None
    assert "lost (" not in table(summarise(short))


@given(
    st.lists(
        st.builds(
            Run,
            predictor=st.sampled_from(["previous", "formation", "ewma"]),
            seed=st.integers(0, 4),
            correction_m=corrections,
            lost=st.booleans(),
            prediction_coverage_90=st.one_of(st.none(), st.floats(0.0, 1.0)),
            formation_error_rmse_m=corrections,
            movements_per_timestep=corrections,
        ),
        max_size=20,
    )
)
def test_the_summary_is_json_without_nan_and_its_table_has_a_line_per_entry(rows: list[Run]) -> None:
    found = summarise(rows)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    lines = table(found).splitlines()
    assert len(lines) == 2 + len(found)
    assert {line.count("|") for line in lines} == {11}
    assert not any(word in "".join(lines) for word in ("nan", "inf", "None"))


def test_the_table_is_in_centimetres_and_percent() -> None:
    rows = [*runs_of("previous", [0.4]), *runs_of("formation", [0.1])]
    assert table(summarise(rows)).splitlines()[-1] == (
        "| two | bowl | formation | 1 | 0 | 10.0 (10.0..10.0) | 75 (75..75) "
        "| 1.00 (1.00..1.00) | 1.50 (1.50..1.50) | 90 |"
    )


def test_a_cell_has_the_median_its_interval_and_no_negative_zero() -> None:
    assert markdown.interval({"median": 0.125, "low": -0.0004, "high": None}, 100.0) == "12.5 (0.0..lost)"
    assert markdown.interval(None) == "-"
    assert markdown.table(["a", "b"], [["1", "2"]]) == ["| a | b |", "|---|---|", "| 1 | 2 |"]
