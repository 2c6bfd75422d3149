"""What a page says of a sweep."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from robot_formation.analysis.conditions import conditions_text
from robot_formation.analysis.sweep_summary import BASELINE, summarise
from robot_formation.bag.provenance import versions
from robot_formation.errors import FormationError
from robot_formation.experiment.path_plan import STRAIGHT
from robot_formation.experiment.sweep import CONDITIONS, Plan, Row, read_sweep
from robot_formation.json_values import JsonObject
from robot_formation.reporting.inline_svg import figure
from robot_formation.reporting.markup import element, paragraph, section, table
from robot_formation.reporting.sweep_figures import draw_distributions, draw_reductions, group_name
from robot_formation.system.git_commit import git_commit

_MOST_POINTS = 8000
"""Runs that are drawn one by one in a page, of all groups together."""
_MOST_SEEDS, _LEAST_SEEDS = 200, 20


@dataclass(frozen=True)
class Sweep:
    """A sweep that is reported.

    Attributes:
        number: among those of the page, from 1 on.
        folder: as it was given.
        plan: what it consists of.
        rows: the runs that are there.
    """

    number: int
    folder: Path
    plan: Plan
    rows: Sequence[Row]

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.folder.resolve().name


def load_sweep(number: int, folder: Path) -> Sweep:
    """Read a sweep.

    Raises:
        FormationError: the folder holds no sweep, or is damaged.
    """
    plan, rows = read_sweep(folder)
    return Sweep(number, folder, plan, rows)


def sweep_sections(sweep: Sweep, folder: Path, level: int) -> Iterator[Element]:
    """Yield the sections of a sweep's report.

    Args:
        sweep: the sweep.
        folder: where figures are put for the moment.
        level: of their headings.
    """
    groups: dict[str, list[Row]] = {}
    for row in sweep.rows:
        groups.setdefault(group_name({"track": row.track, "path": row.path, "surface": row.surface}), []).append(row)
    summary = summarise(sweep.rows)
    yield section("What was run", *_what(sweep), level=level)
    if any(entry["reduction"] is not None and entry["predictor"] != BASELINE for entry in summary):
        yield section("Reduction against previous", *_reductions(sweep, summary, folder), level=level)
    seeds = min(_MOST_SEEDS, max(_LEAST_SEEDS, _MOST_POINTS // (len(groups) * len(sweep.plan.predictors))))
    for number, (name, rows) in enumerate(groups.items(), 1):
        entries = [entry for entry in summary if group_name(entry) == name]
        shown = _distribution(f"sweep-{sweep.number}-{number}", name, rows, entries, seeds, folder)
        yield section(f"{name[0].upper()}{name[1:]}", shown, _table(name, entries), level=level)
    command = element("pre", element("code", repeating_command(sweep.plan)), tabindex="0")
    yield section("Repeat this sweep", command, level=level)
    yield section("Versions", *_versions(), level=level)


def _what(sweep: Sweep) -> Iterator[Element]:
    plan, count = sweep.plan, len(sweep.rows)
    planned = len(plan.tracks) * len(plan.paths) * len(plan.surfaces) * len(plan.predictors) * len(plan.seeds)
    left = "" if count == planned else f" {count} of these {planned} runs are there; the others are still to be run."
    yield paragraph(f"Every combination of what follows, {planned} runs, each in one process.{left}")
    rows = [
        ("tracks", ", ".join(plan.tracks)),
        ("paths", ", ".join(plan.paths)),
        ("surfaces", ", ".join(plan.surfaces)),
        ("predictors", ", ".join(plan.predictors)),
        ("seeds", f"{len(plan.seeds)}, from {min(plan.seeds)} to {max(plan.seeds)}"),
        ("conditions", _conditions(plan)),
        *([] if plan.base else [("settings of all sweeps", ", ".join(CONDITIONS))]),
        ("settings of this sweep", ", ".join(plan.settings) or "none"),
    ]
    yield table("What was run", ("what", "values"), rows, class_="words")
    lost = sum(row.lost for row in sweep.rows)
    said = (
        f"{lost} of {count} runs were lost: they did not come to their last timestep." if lost else "No run was lost."
    )
    yield paragraph(said, class_="answer")


def _conditions(plan: Plan) -> str:
    try:
        return conditions_text(plan.conditions())
    except FormationError:  # a track, predictor or setting that this version doesn't have
        return "unknown to this version"


def _reductions(sweep: Sweep, summary: Sequence[JsonObject], folder: Path) -> Iterator[Element]:
    yield paragraph(
        "The reduction is the share by which a predictor corrects less than previous with the same seed: median over "
        "seeds, with its 95 % bootstrap interval. A lost run ranks worse than any other."
    )
    yield figure(
        f"sweep-{sweep.number}-reductions",
        lambda path: draw_reductions(summary, path),
        folder,
        title=f"Interval chart: reduction of each predictor against previous by track, path and surface; {sweep.name}",
        caption="Reduction against previous, median and 95 % interval; right of the line a predictor corrects less. "
        "Arrow: the interval goes on to the left.",
    )


def _distribution(
    name: str, group: str, rows: Sequence[Row], entries: Sequence[JsonObject], seeds: int, folder: Path
) -> Element:
    count = len({row.seed for row in rows})
    some = f" {seeds} of {count} seeds are drawn; medians and intervals are of all." if seeds < count else ""
    return figure(
        name,
        lambda path: draw_distributions(rows, entries, path, seeds),
        folder,
        title=f"Points of all runs by predictor, paired by seed: correction distance and formation error; {group}",
        caption="Each point is a run that was not lost, a line joins the runs of one seed; beside them the median with "
        f"its 95 % interval, in which a lost run is worse than any other.{some}",
    )


def _table(group: str, entries: Sequence[JsonObject]) -> Element:
    heads = (
        "predictor",
        "runs",
        "lost",
        "correction (cm)",
        "reduction (%)",
        "formation error, RMSE (cm)",
        "movements per timestep",
        "in 90 % ellipse (%)",
    )
    rows = [
        (
            str(entry["predictor"]),
            str(entry["runs"]),
            str(entry["lost"]),
            _interval(entry["correction_m"], 100.0, 1),
            _interval(entry["reduction"], 100.0, 0),
            _interval(entry["formation_error_rmse_m"], 100.0, 2),
            _interval(entry["movements_per_timestep"], 1.0, 2),
            "-" if entry["prediction_coverage_90"] is None else f"{100.0 * entry['prediction_coverage_90']:.0f}",
        )
        for entry in entries
    ]
    return table(f"Medians with 95 % intervals, {group}", heads, rows)


def _interval(found: dict[str, float | None] | None, scale: float, digits: int) -> str:
    if found is None:
        return "-"
    middle, low, high = (
        "lost" if found[key] is None else f"{scale * value:.{digits}f}"
        for key in ("median", "low", "high")
        for value in [found[key] or 0.0]
    )
    return f"{middle} ({low} to {high})"


def repeating_command(plan: Plan) -> str:
    """Return the command that repeats a sweep, for a shell; for Python, if it is of a scenario of one's own."""
    if plan.base:
        lists = ("predictors", "seeds", "surfaces", "paths")
        chosen = ", ".join(f"{name}={list(getattr(plan, name))}" for name in lists)
        return (
            "import robot_formation as rf\n"
            f"scenario = rf.Scenario.from_dict({json.loads(plan.base)})\n"
            f"rf.sweep(scenario, {chosen})"
        )
    words = ["formation", "sweep", "--tracks", ",".join(plan.tracks), "--surfaces", ",".join(plan.surfaces)]
    if plan.paths != (STRAIGHT,):
        words += ["--paths", ",".join(plan.paths)]
    words += ["--predictors", ",".join(plan.predictors), "--seeds", _seeds(plan.seeds)]
    for setting in plan.settings:
        words += ["--set", setting]
    return shlex.join(words)


def _seeds(chosen: Sequence[int]) -> str:
    """Write seeds as --seeds takes them: FIRST:END of those that follow one another, in their order."""
    ranges: list[list[int]] = []
    for seed in chosen:
        if ranges and seed == ranges[-1][1]:
            ranges[-1][1] = seed + 1
        else:
            ranges.append([seed, seed + 1])
    return ",".join(str(first) if end == first + 1 else f"{first}:{end}" for first, end in ranges)


def _versions() -> Iterator[Element]:
    rows = [*versions().items(), ("git commit", git_commit() or "-")]
    yield paragraph("A sweep's folder does not tell them. These are those that made this page.")
    yield table("Versions that made this page", ("what", "version"), rows, class_="words")
