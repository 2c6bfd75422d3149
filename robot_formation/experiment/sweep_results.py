"""What is said of a sweep when its runs are done: text, JSON, files in its folder."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from robot_formation.analysis.conditions import conditions_text
from robot_formation.analysis.sweep_figure import draw_sweep
from robot_formation.analysis.sweep_summary import table
from robot_formation.experiment.sweep import RUNS_NAME, Plan, Row
from robot_formation.json_values import JsonObject

SUMMARY_NAME = "summary.json"
TABLE_NAME = "summary.md"
PICTURE_NAME = "corrections"
FEW_SEEDS = 5
"""Of n seeds, the whole range of values covers the median with a probability of 1 - 2**(1 - n): 94 % for five."""


def announcements(plan: Plan) -> Iterator[str]:
    """Yield what is said before a sweep begins: which seeds are run, and if they are too few or a path turns."""
    yield seeds_text(plan.seeds)
    if len(plan.seeds) < FEW_SEEDS:
        yield f"warning: intervals say nothing with fewer than {FEW_SEEDS} seeds; 20 are --seeds 0:20"
    turning = [path for path in plan.paths if plan.turns_unfollowed(path)]
    if turning:
        yield f"warning: {', '.join(turning)} turns, which mode paper can't follow: --set fine_tuner.mode=precise"


def sweep_text(plan: Plan, summary: Sequence[JsonObject]) -> str:
    """Return a summary for the terminal: a table in Markdown, and under what conditions all runs were made."""
    settings = f"; {', '.join(plan.settings)}" if plan.settings else ""
    conditions = f"{conditions_text(plan.conditions())}, in one process; {seeds_text(plan.seeds)}{settings}"
    return f"{table(summary)}\n\nConditions: {conditions}"


def sweep_report(
    plan: Plan, summary: Sequence[JsonObject], folder: Path | None = None, pictures: Sequence[Path] = ()
) -> JsonObject:
    """Return what the command line's JSON says of a sweep.

    Args:
        plan: the sweep.
        summary: of its runs, by `summarise`.
        folder: of the results; None: there is none.
        pictures: that were drawn.
    """
    # No run is recorded; all came to an end.
    files: JsonObject = {"bag": None, "pictures": [str(picture) for picture in pictures], "reason": None}
    return {"runs": None if folder is None else str(folder / RUNS_NAME), **_said(plan, summary), **files}


def write_results(
    folder: Path, plan: Plan, rows: Sequence[Row], summary: Sequence[JsonObject], picture_format: str = "png"
) -> Path:
    """Write summary and picture into the sweep's folder; return the picture's path.

    Raises:
        FormationError: a file can't be written.
    """
    (folder / SUMMARY_NAME).write_text(json.dumps(_said(plan, summary), indent=2) + "\n", encoding="utf-8")
    (folder / TABLE_NAME).write_text(sweep_text(plan, summary) + "\n", encoding="utf-8")
    return draw_sweep(rows, folder / f"{PICTURE_NAME}.{picture_format}")


def _said(plan: Plan, summary: Sequence[JsonObject]) -> JsonObject:
    return {
        "summary": list(summary),
        "tracks": list(plan.tracks),
        "paths": list(plan.paths),
        "surfaces": list(plan.surfaces),
        "predictors": list(plan.predictors),
        "seeds": list(plan.seeds),
        "settings": list(plan.settings),
        "conditions": plan.conditions(),
    }


def seeds_text(chosen: Sequence[int]) -> str:
    """Describe seeds in words: '1 seed: 5', 'seeds 0 to 4 (5 seeds)', 'seeds 0 to 2, 7 (4 seeds)'."""
    if len(chosen) == 1:
        return f"1 seed: {chosen[0]}"
    ranges: list[list[int]] = []
    for seed in sorted(chosen):
        if ranges and seed == ranges[-1][-1] + 1:
            ranges[-1][1:] = [seed]
        else:
            ranges.append([seed])
    said = [" to ".join(map(str, ends)) for ends in ranges]
    shown = said if len(said) <= 10 else [*said[:9], f"... {said[-1]}"]
    return f"seeds {', '.join(shown)} ({len(chosen)} seeds)"
