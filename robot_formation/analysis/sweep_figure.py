"""Picture of a sweep: how each predictor's correction distances are distributed, with the seeds' pairs as lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.style import BLACK, BLUE, LOST_COLOUR, styled
from robot_formation.analysis.sweep_summary import RunRow, median_with_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
_COLUMNS = 3
_MOST_LINES = 60
"""Seeds whose pairs are drawn; more lines only make a grey area."""
_SPREAD = 0.16  # of a predictor's points, to either side


@styled
def draw_sweep(rows: Sequence[RunRow], path: str | Path) -> Path:
    """Draw every run's correction distance by predictor, a panel for each track, path and surface.

    A thin line connects the runs of one seed (of the first 60 seeds). Bars are medians, with 95 % bootstrap intervals
    as boxes. Runs that didn't come to their end rank worst: they lie above the axis, in the strip "lost".

    Args:
        rows: of the sweep, at least one.
        path: file to write; an older picture there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    groups = sweep_groups(rows)
    predictors = list(dict.fromkeys(row.predictor for row in rows))
    columns = min(_COLUMNS, len(groups))
    lines = -(-len(groups) // columns)
    width = max(3.4, 0.95 * len(predictors) + 1.0)
    figure = new_figure(max(4.8, width * columns), 0.8 + 3.5 * lines)
    panels = figure.subplots(lines, columns, squeeze=False, sharey=True)
    highest = _highest(rows)
    for axes, (group, runs) in zip(panels.flat, groups.items(), strict=False):
        sweep_panel(axes, runs, predictors, highest)
        axes.set_title(_title(group))
    for axes in panels.flat[len(groups) :]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel("correction distance\nfrom timestep 4 on (cm)")
    count = len({row.seed for row in rows})
    figure.suptitle(f"{count} {'seed' if count == 1 else 'seeds'} of each")
    handles = {handle.get_label(): handle for axes in panels.flat for handle in axes.get_legend_handles_labels()[0]}
    legend_below(figure, list(handles.values()), 4 if columns > 1 else 2)
    return save_figure(figure, path)


def sweep_groups(rows: Sequence[RunRow]) -> dict[tuple[str, str, str], list[RunRow]]:
    """Return the runs of each panel, by track, path and surface."""
    groups: dict[tuple[str, str, str], list[RunRow]] = {}
    for row in rows:
        groups.setdefault((row.track, row.path, row.surface), []).append(row)
    return groups


def _highest(rows: Sequence[RunRow]) -> float:
    """Return the largest correction distance of runs that came to their end, centimetres."""
    return max((row.correction_m or 0.0 for row in rows if not row.lost), default=0.0) * _CM or 1.0


def _title(group: tuple[str, str, str]) -> str:
    track, path, surface = group
    return " · ".join([f"track {track.replace('_', ' ')}", *([path] if path != "straight" else []), surface])


def sweep_panel(axes: Axes, runs: Sequence[RunRow], predictors: Sequence[str], highest: float | None = None) -> None:
    """Draw every run's correction distance by predictor, centimetres.

    Args:
        axes: what to draw into.
        runs: of one track, path and surface.
        predictors: in the order of the x axis.
        highest: distance that has to fit in, centimetres; None: the largest of these runs.
    """
    highest = _highest(runs) if highest is None else highest
    by_predictor = {name: {row.seed: row for row in runs if row.predictor == name} for name in predictors}
    seeds = sorted({row.seed for row in runs})
    strip = 1.14 * highest
    heights = np.array([[_height(by_predictor[name].get(seed), strip) for name in predictors] for seed in seeds])
    aside = np.linspace(-_SPREAD, _SPREAD, len(seeds)) * (len(seeds) > 1)
    for number, line in enumerate(heights[:_MOST_LINES]):
        label = "one seed" if number == 0 else None
        axes.plot(np.arange(len(predictors)) + aside[number], line, color="0.80", linewidth=0.7, zorder=1, label=label)
    for place, name in enumerate(predictors):
        _points(axes, place + aside, heights[:, place], strip)
        _summary(axes, place, by_predictor[name], highest)
    if (heights == strip).any():
        axes.axhspan(1.07 * highest, 1.21 * highest, color="0.95", zorder=0, linewidth=0)
        axes.annotate("lost", (0.0, strip), (3, 0), ("axes fraction", "data"), textcoords="offset points", va="center")
    axes.set(ylim=(0.0, 1.22 * highest), xlim=(-0.6, len(predictors) - 0.4))
    axes.set_xticks(range(len(predictors)), predictors, rotation=20 if len(predictors) > 3 else 0)
    axes.grid(axis="y")


def _height(row: RunRow | None, strip: float) -> float:
    if row is None:
        return np.nan
    if row.lost:
        return strip
    return np.nan if row.correction_m is None else row.correction_m * _CM


def _points(axes: Axes, places: NDArray[np.float64], heights: NDArray[np.float64], strip: float) -> None:
    """Draw a predictor's runs side by side, in the order of their seeds; lost ones as crosses."""
    lost = heights == strip
    style: dict[str, Any] = {"linestyle": "none", "markersize": 3.5, "zorder": 2}
    axes.plot(places[~lost], heights[~lost], "o", color=BLUE, alpha=0.55, label="run", **style)
    if lost.any():
        axes.plot(places[lost], heights[lost], "x", color=LOST_COLOUR, label="lost run", **style)
        count = f"{int(lost.sum())} of {int(np.isfinite(heights).sum())}"
        axes.annotate(count, (float(places.mean()), strip), (0, 7), textcoords="offset points", ha="center", fontsize=8)


def _summary(axes: Axes, place: int, runs: Mapping[int, RunRow], highest: float) -> None:
    ranks = [np.inf if row.lost else row.correction_m for row in runs.values()]
    found = median_with_interval([rank for rank in ranks if rank is not None])
    if found is None or found["median"] is None:
        return
    low, middle = ((found[name] or 0.0) * _CM for name in ("low", "median"))
    high = 1.07 * highest if found["high"] is None else found["high"] * _CM
    axes.bar(
        place,
        high - low,
        0.56,
        bottom=low,
        facecolor="none",
        edgecolor=BLACK,
        linewidth=0.9,
        zorder=3,
        label="95 % interval of the median" if place == 0 else None,
    )
    axes.plot([place - 0.28, place + 0.28], [middle, middle], color=BLACK, linewidth=2.2, zorder=4, label="median")
