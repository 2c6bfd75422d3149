"""Totals of runs side by side: one row per quantity, one column per run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from robot_formation.analysis.quantities import FollowerAnalysis
from robot_formation.json_values import Json, JsonObject
from robot_formation.reporting.differences import differing, value_text
from robot_formation.reporting.runs import Run, follower_names
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

_CM, _DEG, _PERCENT = 100.0, math.degrees(1.0), 100.0
_NONE = "-"


@dataclass(frozen=True)
class ComparisonTable:
    """A table: its title, and rows of a quantity's name and its value in each run."""

    title: str
    rows: tuple[tuple[str, tuple[str, ...]], ...]


def comparisons(runs: Sequence[Run]) -> list[ComparisonTable]:
    """Set runs side by side: what they were and how they ended, then each follower's totals."""
    return [_overview(runs), *(_follower(name, runs) for name in follower_names(runs))]


def differing_rows(runs: Sequence[Run], most: int = 60) -> ComparisonTable:
    """Set side by side what the runs say differently of themselves; values are cut to so many characters."""
    found = differing([run.record.details for run in runs])
    rows = [(name, tuple(value_text(entry, most) for entry in values)) for name, values in found.items()]
    return ComparisonTable("What differs", tuple(rows))


def comparison_text(runs: Sequence[Run]) -> str:
    """Return the comparison as text for the terminal."""
    names = "\n".join(f"{run.label}  {run.bag}" for run in runs)
    heads = ["", *(run.label for run in runs)]
    differs = differing_rows(runs)
    shown = [*comparisons(runs), *([differs] if differs.rows else [])]
    sections = [names, *(f"{found.title}\n{_aligned(heads, found)}" for found in shown)]
    if not differs.rows:
        sections.append("The runs say nothing of themselves that differs.")
    return "\n\n".join(sections)


def comparison_json(runs: Sequence[Run]) -> JsonObject:
    """Return the runs as `formation analyze --json` prints each, and what differs in what they say of themselves."""
    return {
        "runs": [run.to_json() for run in runs],
        "differing": differing([run.record.details for run in runs]),
    }


def _overview(runs: Sequence[Run]) -> ComparisonTable:
    facts = [{**run.facts, "scenario": run.analysis.scenario, "outcome": run.analysis.outcome} for run in runs]
    rows = [
        (name, tuple(value_text(each[name]) for each in facts))
        for name in ("scenario", "predictor", "path", "surface", "seed", "outcome")
    ]
    rows.append(("followers", tuple(str(len(run.analysis.followers)) for run in runs)))
    rows.append(("simulated time (s)", tuple(f"{run.record.simulated_s:.1f}" for run in runs)))
    return ComparisonTable("Runs", tuple(rows))


def _follower(name: str, runs: Sequence[Run]) -> ComparisonTable:
    followers = [run.follower(name) for run in runs]
    rows = [(title, tuple(_cell(follower, write) for follower in followers)) for title, write in _ROWS]
    rows.insert(_AGAINST_FIRST, (f"  against {runs[0].label} (%)", _against_first(followers)))
    told = [row for row in rows if not set(row[1]) <= ({_NONE, "0", "0.00"} if row[0] in _RARE else {_NONE})]
    return ComparisonTable(name.replace("_", " "), tuple(told))


def _cell(follower: FollowerAnalysis | None, write: Callable[[JsonObject], str]) -> str:
    return _NONE if follower is None else write(follower.totals)


def _scaled(key: str, scale: float, digits: int = 2) -> Callable[[JsonObject], str]:
    return lambda totals: number_text(totals[key], scale, digits)


def number_text(value: Json, scale: float, digits: int = 2) -> str:
    """Write a number that may be unknown, in another unit."""
    # Adding zero turns a rounded -0.0 into 0.0.
    return _NONE if value is None else f"{round(value * scale, digits) + 0.0:.{digits}f}"


def _timesteps(totals: JsonObject) -> str:
    planned = totals["timesteps_planned"]
    return f"{totals['timesteps_finished']}{'' if planned is None else f' of {planned}'}"


def _losses(totals: JsonObject) -> str:
    losses = totals["losses"]
    return f"{len(losses)} ({totals['reacquired']} reacquired)" if losses else "0"


def _against_first(followers: Sequence[FollowerAnalysis | None]) -> tuple[str, ...]:
    """Write by how much each correction distance is above the first run's, per cent."""
    found = [None if follower is None else follower.totals["correction_m"] for follower in followers]
    first = found[0]
    if not first:
        return (_NONE,) * len(found)
    return (_NONE, *(_NONE if each is None else f"{_PERCENT * (each / first - 1.0):+.1f}" for each in found[1:]))


_FROM = f"from timestep {COLLECTION_TIMESTEPS + 1}"
_ROWS: tuple[tuple[str, Callable[[JsonObject], str]], ...] = (
    ("timesteps finished", _timesteps),
    (f"correction distance {_FROM} (cm)", _scaled("correction_m", _CM)),
    ("  along u (cm)", _scaled("correction_u_m", _CM)),
    ("  along v (cm)", _scaled("correction_v_m", _CM)),
    ("  turns (deg)", _scaled("correction_turn_rad", _DEG)),
    ("movements", lambda totals: str(totals["movements"])),
    ("  per timestep", _scaled("movements_per_timestep", 1.0)),
    ("formation error, RMSE (cm)", _scaled("formation_error_rmse_m", _CM)),
    ("  bias u (cm)", _scaled("formation_error_bias_u_m", _CM)),
    ("  bias v (cm)", _scaled("formation_error_bias_v_m", _CM)),
    ("  scatter (cm)", _scaled("formation_error_scatter_m", _CM)),
    ("  largest (cm)", _scaled("formation_error_max_m", _CM)),
    ("heading error, RMSE (deg)", _scaled("heading_error_rmse_rad", _DEG)),
    ("lag (cm)", _scaled("lag_m", _CM)),
    ("ideal moves in the 90 % ellipse (%)", _scaled("prediction_coverage_90", _PERCENT, 0)),
    ("neighbour out of view", _losses),
    ("blind timesteps", lambda totals: str(totals["blind_timesteps"])),
)
_RARE = ("lag (cm)", "blind timesteps")  # left out where they are 0 in all runs
_AGAINST_FIRST = 2  # place of the row below the correction distance


def _aligned(heads: Sequence[str], found: ComparisonTable) -> str:
    lines = [tuple(heads), *((name, *values) for name, values in found.rows)]
    first, *others = (max(len(line[column]) for line in lines) for column in range(len(heads)))
    texts = [
        "  ".join([name.ljust(first), *(cell.rjust(width) for cell, width in zip(cells, others, strict=True))])
        for name, *cells in lines
    ]
    return "\n".join([texts[0], "-" * len(texts[0]), *texts[1:]])
