"""What a page says of several runs together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

from robot_formation.reporting.comparison_figures import (
    draw_corrections_by_timestep,
    draw_errors_by_timestep,
    draw_trajectories,
)
from robot_formation.reporting.comparison_table import comparisons, differing_rows
from robot_formation.reporting.inline_svg import figure
from robot_formation.reporting.markup import Content, element, paragraph, section, table
from robot_formation.reporting.runs import Run

_LONG_VALUE = 120


def comparison_sections(runs: Sequence[Run], folder: Path) -> Iterator[Element]:
    """Yield the sections of a comparison.

    Args:
        runs: two or more.
        folder: where figures are put for the moment.
    """
    listed = [element("li", element("a", f"{run.label}: {run.name}", href=f"#{anchor(run)}")) for run in runs]
    heads = ["", *(run.label for run in runs)]
    tables = [
        table(found.title, heads, [(name, *values) for name, values in found.rows]) for found in comparisons(runs)
    ]
    yield section("Side by side", element("ul", *listed), *tables)
    yield section("Corrections and errors of all runs", *_figures(runs, folder))
    differs = differing_rows(runs, _LONG_VALUE)
    rows: list[tuple[Content, ...]] = [(element("code", name), *values) for name, values in differs.rows]
    shown = table("What the runs say differently of themselves", heads, rows, class_="words")
    yield section("What differs", shown if rows else paragraph("Nothing of what the runs say of themselves."))


def anchor(run: Run) -> str:
    """Return the id of a run's own section."""
    return f"run-{run.number}"


def _figures(runs: Sequence[Run], folder: Path) -> list[Element]:
    names = ", ".join(f"{run.label} is {run.name}" for run in runs)
    return [
        figure(
            "all-corrections",
            lambda path: draw_corrections_by_timestep(runs, path),
            folder,
            title=f"Line chart: correction distance of each timestep, a line per run; {names}",
            caption="Correction distance of each timestep, u and v together. Cross: where a follower lost its "
            "neighbour.",
        ),
        figure(
            "all-errors",
            lambda path: draw_errors_by_timestep(runs, path),
            folder,
            title=f"Line chart: formation error and heading error of each timestep, a line per run; {names}",
            caption="Formation error and heading error at the end of each timestep, by ground truth.",
        ),
        figure(
            "all-trajectories",
            lambda path: draw_trajectories(runs, path),
            folder,
            title=f"Map: true paths of all runs from above over contour lines; {names}",
            caption="True paths from above, over contour lines.",
        ),
    ]
