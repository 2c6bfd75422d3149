"""Tables of `leader_paths.py`: medians over seeds, and paired ratios with 95 % bootstrap intervals."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from leader_path_runs import HORIZONS, PATHS, PHASES, Row
from robot_formation.analysis.markdown import interval, table
from robot_formation.analysis.sweep_summary import median_with_interval

OWN, BASELINE = "formation", "previous+close"
COMPARED = (BASELINE, OWN)
OTHERS = ("previous", BASELINE, "trend+close", "edmd+close")
"""What `formation` is compared with on the page of results."""
PAIRED = (BASELINE, "trend+close")
"""The two without a Koopman operator that it is paired with there."""

Runs = dict[tuple[str, str], dict[str, dict[int, Row]]]
"""Rows by path and surface, then predictor, then seed."""


def grouped(rows: Sequence[Row]) -> Runs:
    """Sort rows."""
    found: Runs = {}
    for row in rows:
        found.setdefault((row.path, row.surface), {}).setdefault(row.predictor, {})[row.seed] = row
    return found


def rank(row: Row) -> float:
    """Correction distance [m], infinite for a run that didn't come to its end."""
    return math.inf if row.outcome != "done" or row.correction_m is None else row.correction_m


def ratios(own: Mapping[int, Row], other: Mapping[int, Row]) -> list[float]:
    """Paired ratios of correction distances, over the seeds that both have; a lost run is infinitely worse."""
    found = []
    for seed in own.keys() & other.keys():
        a, b = rank(own[seed]), rank(other[seed])
        if math.isinf(a) and math.isinf(b):
            continue  # nothing to compare
        found.append(math.inf if math.isinf(a) else a / b if b > 0.0 else 1.0 if a == 0.0 else math.inf)
    return found


def cell(values: Sequence[float], scale: float = 1.0, digits: int = 1) -> str:
    """Median with its 95 % bootstrap interval."""
    return interval(median_with_interval(values), scale, digits)


def known(runs: Mapping[int, Row], name: str) -> list[float]:
    """Collect a column where it is known."""
    values = [getattr(row, name) for row in runs.values()]
    return [value for value in values if value is not None]


def print_table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print("", *table(head, lines), sep="\n")


def ratio_lines(runs: Runs, others: Sequence[str]) -> Iterator[list[str]]:
    """Yield the lines of the table of ratios: path and surface, and then every path over all of its surfaces."""
    of_path: dict[str, list[list[list[float]]]] = {}
    for (path, surface), found in runs.items():
        best = min(others, key=lambda name: middle_rank(found.get(name, {})))
        compared = [ratios(found.get(OWN, {}), found.get(name, {})) for name in [*others, best]]
        of_path.setdefault(path, []).append(compared)
        yield [path, surface, *(cell(values, 1.0, 2) for values in compared)]
    for path, surfaces in of_path.items():
        if len(surfaces) > 1:
            columns = zip(*surfaces, strict=True)
            yield [path, "all", *(cell(list(itertools.chain(*column)), 1.0, 2) for column in columns)]


def surface_lines(rows: Sequence[Row], surface: str) -> list[str]:
    """Return the page's table of one surface: medians of the correction distance, and paired ratios."""
    runs = grouped(rows)
    head = ["path", "runs", "lost", *(f"`{name}`" for name in (*OTHERS, OWN))]
    head += [*(f"/ `{name}`" for name in PAIRED), "/ best of the others"]
    lines = []
    for path in PATHS:
        if found := runs.get((path, surface)):
            medians = [middle([rank(row) for row in found.get(name, {}).values()], 100.0) for name in OTHERS]
            own = cell([rank(row) for row in found.get(OWN, {}).values()], 100.0)
            lines.append([path, *_counts(found), *medians, own, *_page_ratios(found)])
    return table(head, lines)


def _counts(found: Mapping[str, Mapping[int, Row]]) -> list[str]:
    """Runs of `formation` (and fewest of another predictor, if fewer), and lost runs of all predictors of the page."""
    own = len(found.get(OWN, {}))
    fewest = min(len(found.get(name, {})) for name in OTHERS)
    lost = {name: lost_runs(found.get(name, {})) for name in (*OTHERS, OWN)}
    said = ", ".join(f"`{name}` {count}" for name, count in lost.items() if count)
    return [str(own) if fewest == own else f"{own} ({fewest})", said or "0"]


def _page_ratios(found: Mapping[str, Mapping[int, Row]]) -> list[str]:
    """Ratios to the predictors without a Koopman operator, and to the best of all others."""
    best = min(OTHERS, key=lambda name: middle_rank(found.get(name, {})))
    return [cell(ratios(found.get(OWN, {}), found.get(name, {})), 1.0, 2) for name in (*PAIRED, best)]


def phase_lines(rows: Sequence[Row], surface: str) -> list[str]:
    """Return the page's table by phase of the run: medians of the baseline / those of `formation`."""
    runs = grouped(rows)
    spans = [phase.replace("_", " to ") if "_" in phase else f"from {phase}" for phase in PHASES]
    head = ["path", *spans, *spans, "formation", "in the ellipse (%)", "half of the weight"]
    lines = []
    for path in PATHS:
        if found := runs.get((path, surface)):
            correction, other = [*details(found)][: len(PHASES)], [*details(found)][len(PHASES) :]
            errors = [_compared(found, f"prediction_rmse_{phase}_m") for phase in PHASES]
            lines.append([path, *correction, *errors, *other])
    return table(head, lines)


def middle_rank(runs: Mapping[int, Row]) -> float:
    """Median correction distance [m] of a predictor's runs, infinite without any."""
    return float(np.median([rank(row) for row in runs.values()])) if runs else math.inf


def details(found: Mapping[str, Mapping[int, Row]]) -> Iterator[str]:
    """Yield the cells of the table by phase."""
    for phase in PHASES:
        yield _compared(found, f"correction_{phase}_m")
    yield _compared(found, "formation_error_rmse_m", 2)
    own = found.get(OWN, {})
    shares = [known(own, f"coverage_{horizon}") for horizon in HORIZONS]
    yield " / ".join(f"{100.0 * float(np.mean(share)):.0f}" if share else "-" for share in shares)
    reached = known(own, "half_weight_timestep")
    yield f"{float(np.median(reached)):.0f} ({len(reached)} of {len(own)})" if reached else f"0 of {len(own)}"


def _compared(found: Mapping[str, Mapping[int, Row]], name: str, digits: int = 1) -> str:
    """Medians of a column [cm]: of the baseline / of `formation`."""
    return " / ".join(middle(known(found.get(predictor, {}), name), 100.0, digits) for predictor in COMPARED)


def middle(values: Sequence[float], scale: float, digits: int = 1) -> str:
    """Median of values, or a dash."""
    return f"{scale * float(np.median(values)):.{digits}f}" if values else "-"


def lost_runs(runs: Mapping[int, Row]) -> int:
    """Count the runs that didn't come to their end."""
    return sum(row.outcome != "done" for row in runs.values())
