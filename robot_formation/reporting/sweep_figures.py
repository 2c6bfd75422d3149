"""Pictures of a sweep: each predictor's distribution over seeds, paired by seed, and reductions with intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.style import LOST_COLOUR, PALETTE, styled
from robot_formation.analysis.sweep_summary import BASELINE
from robot_formation.experiment.sweep import Row
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
_WIDTH = 5.6  # inches, as of the pictures of single runs
_QUANTITIES = (
    ("correction_m", "correction distance (cm)"),
    ("formation_error_rmse_m", "formation error, RMSE (cm)"),
)
_HALF = 0.22  # from a predictor's place to its points' and to its median's
_LEAST_SHOWN = -150.0  # per cent; a predictor that corrects little may multiply what is nearly nothing


@styled
def draw_distributions(rows: Sequence[Row], summary: Sequence[JsonObject], path: Path, most_seeds: int) -> Path:
    """Draw the runs of one track, path and surface: a point per run, a line per seed, medians with intervals.

    Args:
        rows: the runs.
        summary: what `summarise` says of them, an entry per predictor.
        path: file to write.
        most_seeds: that are drawn one by one, evenly chosen; medians and intervals are of all.

    Raises:
        AnalysisError: the file can't be written.
    """
    predictors = [str(entry["predictor"]) for entry in summary]
    figure = new_figure(_WIDTH, 6.4)
    panels = figure.subplots(2, 1, sharex=True)
    seeds = _spread(sorted({row.seed for row in rows}), most_seeds)
    for axes, (key, title) in zip(panels, _QUANTITIES, strict=True):
        _points(axes, rows, predictors, seeds, key)
        for number, entry in enumerate(summary):
            _median(axes, number, entry[key])
        axes.set_ylabel(title)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.grid(axis="y")
    turned = {"rotation": 30, "ha": "right"} if sum(map(len, predictors)) > 40 else {}
    panels[-1].set_xticks(range(len(predictors)), predictors, **turned)
    panels[-1].set_xlim(-0.6, len(predictors) - 0.4)
    _legend(figure, any(row.lost for row in rows))
    return save_figure(figure, path)


@styled
def draw_reductions(summary: Sequence[JsonObject], path: Path) -> Path:
    """Draw each predictor's reduction against `previous` with its interval: a row per track, path and surface.

    Args:
        summary: entries of `summarise`, of which at least one has a reduction.
        path: file to write.

    Raises:
        AnalysisError: the file can't be written.
    """
    from matplotlib.lines import Line2D

    known = [entry for entry in summary if entry["reduction"] is not None and entry["predictor"] != BASELINE]
    groups = list(dict.fromkeys(group_name(entry) for entry in known))
    # By their places among all, so that a predictor has one colour in all pictures.
    numbers = {name: number for number, name in enumerate(dict.fromkeys(str(entry["predictor"]) for entry in summary))}
    predictors = [name for name in numbers if any(entry["predictor"] == name for entry in known)]
    finite = [100.0 * value for entry in known for value in entry["reduction"].values() if value is not None]
    low = max(_LEAST_SHOWN, min([0.0, *finite]) - 6.0)
    figure = new_figure(_WIDTH, 1.3 + len(groups) * (0.35 + 0.2 * len(predictors)))
    axes = figure.subplots()
    for entry in known:
        offset = (predictors.index(entry["predictor"]) + 0.5) / len(predictors) - 0.5
        place = groups.index(group_name(entry)) + 0.75 * offset
        _interval(axes, place, entry["reduction"], low, numbers[entry["predictor"]])
    axes.axvline(0.0, color="0.4", linewidth=1.0)
    axes.set_xlim(low, max([5.0, *finite]) + 5.0)
    axes.set_ylim(len(groups) - 0.5, -0.5)
    axes.set_yticks(range(len(groups)), groups)
    axes.set_xlabel("reduction against previous (%)")
    axes.grid(axis="x")
    handles = [Line2D([], [], linestyle="none", label=name, **_mark(numbers[name])) for name in predictors]
    legend_below(figure, handles, min(3, len(handles)), fontsize=9)
    return save_figure(figure, path)


def group_name(entry: JsonObject) -> str:
    """Name a group of runs by track, path and surface; a straight path is not told."""
    path = "" if entry["path"] == "straight" else f", {entry['path']}"
    return f"track {entry['track']}{path}, {entry['surface']}"


def _points(axes: Axes, rows: Sequence[Row], predictors: Sequence[str], seeds: Sequence[int], key: str) -> None:
    values = {(row.predictor, row.seed): getattr(row, key) for row in rows if not row.lost}
    lost = {(row.predictor, row.seed) for row in rows if row.lost}
    cm = np.array([[_known(values.get((name, seed))) for name in predictors] for seed in seeds]) * _CM
    places = np.arange(len(predictors)) - _HALF
    # One line with gaps takes a tenth of the room of one line per seed.
    gaps = np.full((len(seeds), 1), math.nan)
    xs = np.hstack([np.tile(places, (len(seeds), 1)), gaps])
    axes.plot(xs.ravel(), np.hstack([cm, gaps]).ravel(), color="0.6", linewidth=0.5, alpha=0.6, zorder=1)
    for number in range(len(predictors)):
        axes.plot(
            np.full(len(seeds), places[number]),
            cm[:, number],
            "o",
            color=_colour(number),
            markersize=3,
            alpha=0.6,
            markeredgewidth=0,
            zorder=2,
        )
    for number, name in enumerate(predictors):
        count = sum(predictor == name for predictor, _ in lost)
        if count:
            style: dict[str, Any] = {"color": LOST_COLOUR, "fontsize": 9, "ha": "center", "va": "bottom"}
            axes.text(number, 1.01, f"× {count} lost", transform=axes.get_xaxis_transform(), **style)


def _median(axes: Axes, number: int, found: dict[str, float | None] | None) -> None:
    """Draw a median with its interval; what is infinite, that is lost, ends at the picture's upper edge."""
    if found is None:
        return
    if found["median"] is None:
        upper = axes.get_xaxis_transform()
        axes.text(number + _HALF, 0.98, "lost", transform=upper, color=LOST_COLOUR, ha="center", va="top", fontsize=9)
        return
    middle = found["median"] * _CM
    low = middle if found["low"] is None else found["low"] * _CM
    place, colour = number + _HALF, _colour(number)
    if found["high"] is None:
        axes.plot([place, place], [low, middle], color=colour, linewidth=2.0, zorder=3)
        axes.annotate(
            "",
            (place, 1.0),
            (place, middle),
            xycoords=axes.get_xaxis_transform(),
            textcoords="data",
            arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 2.0},
        )
    else:
        axes.plot([place, place], [low, found["high"] * _CM], color=colour, linewidth=2.0, zorder=3)
    axes.plot([place], [middle], "D", color=colour, markersize=7, zorder=4)
    axes.annotate(f"{middle:.3g}", (place, middle), (7, 0), textcoords="offset points", va="center", fontsize=9)


def _interval(axes: Axes, place: float, found: dict[str, float | None], edge: float, number: int) -> None:
    """Draw a reduction with its interval; what is beyond the left edge, or infinitely bad, ends there in an arrow."""
    if found["median"] is None:
        axes.annotate(
            "lost", (edge, place), (3, 0), textcoords="offset points", va="center", fontsize=9, color=LOST_COLOUR
        )
        return
    middle = 100.0 * found["median"]
    left = edge if found["low"] is None else max(100.0 * found["low"], edge)
    right = middle if found["high"] is None else 100.0 * found["high"]
    axes.plot([left, max(right, edge)], [place, place], color=_colour(number), linewidth=2.0)
    if left == edge:
        axes.plot([edge], [place], "<", color=_colour(number), markersize=7, clip_on=False)
    if middle >= edge:
        axes.plot([middle], [place], linestyle="none", clip_on=False, **_mark(number))


def _mark(number: int) -> dict[str, Any]:
    return {"marker": "Dos^v<>"[number % 7], "color": _colour(number), "markersize": 6}


def _colour(number: int) -> str:
    return PALETTE[number % len(PALETTE)]


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def _spread(seeds: Sequence[int], most: int) -> list[int]:
    """Choose at most so many, evenly."""
    count = min(most, len(seeds))
    return [seeds[index * len(seeds) // count] for index in range(count)]


def _legend(figure: Any, some_lost: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], marker="o", linestyle="none", color="0.4", markersize=4, label="a run"),
        Line2D([], [], color="0.6", linewidth=0.8, label="the same seed"),
        Line2D([], [], marker="D", color="0.4", linewidth=2.0, markersize=6, label="median, 95 % interval"),
    ]
    if some_lost:
        handles.append(Line2D([], [], linestyle="none", marker="x", color=LOST_COLOUR, label="lost runs"))
    legend_below(figure, handles, 4, fontsize=9)
