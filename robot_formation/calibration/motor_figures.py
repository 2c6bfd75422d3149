"""Pictures of calibrations: the motors' curves with their residuals, and three instruments' distances compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Polynomial

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.style import BLACK, BLUE, GREEN, VERMILION, styled
from robot_formation.calibration.encoder_comparison import DistanceComparison
from robot_formation.calibration.motor_fit import AxisFit
from robot_formation.names import LEADER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM, _MM = 100.0, 1000.0
_AXIS_NAMES = {"v": "along v", "u": "along u"}
_PANEL_WIDTH = 3.6


@styled
def draw_motors(fits: Mapping[str, Mapping[str, AxisFit]], title: str, path: str | Path) -> Path:
    """Draw distance against wheel rotation with the fitted curve, and below what is left of each point.

    Panels as in the paper: each follower along v and u, then the leader along v. Turns are not drawn.

    Raises:
        AnalysisError: the file can't be written.
    """
    followers = [robot for robot in fits if robot != LEADER]
    panels = [(robot, axis) for robot in followers for axis in ("v", "u")]
    panels += [(robot, "v") for robot in fits if robot == LEADER]
    figure = new_figure(_PANEL_WIDTH * len(panels), 4.6)
    axes = figure.subplots(
        2, len(panels), sharex="col", sharey="row", squeeze=False, gridspec_kw={"height_ratios": (3, 1)}
    )
    for column, (robot, axis) in enumerate(panels):
        _curve_panel(axes[0, column], fits[robot][axis])
        _residual_panel(axes[1, column], fits[robot][axis])
        name = robot.replace("_", " ")
        axes[0, column].set_title(f"({chr(ord('a') + column)}) {name}, {_AXIS_NAMES[axis]}")
        axes[1, column].set_xlabel("wheel rotation (rad)")
        axes[1, column].autoscale(axis="x")
    axes[0, 0].set_ylabel("travelled distance (cm)")
    axes[1, 0].set_ylabel("measured -\ncurve (mm)")
    handles = axes[0, 0].get_legend_handles_labels()[0] + axes[1, 0].get_legend_handles_labels()[0]
    legend_below(figure, handles, 3)
    figure.suptitle(title)
    return save_figure(figure, path)


@styled
def draw_encoders(comparisons: Sequence[DistanceComparison], title: str, path: str | Path) -> Path:
    """Draw by how much the distances of three instruments differ from the preset ones, and below sensing - reference.

    The distances themselves would lie on one diagonal. Below: bars in per cent of the reference, as in the paper, with
    the standard deviation of single drives.

    Raises:
        AnalysisError: the file can't be written.
    """
    from matplotlib.lines import Line2D

    figure = new_figure(9.6, 5.6)
    panels = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=(1.5, 1))
    for number, axis in enumerate(("v", "u")):
        rows = [row for row in comparisons if row.axis == axis]
        _distances(panels[0, number], rows)
        _percentage_bars(panels[1, number], rows)
        panels[0, number].set_title(f"({chr(ord('a') + number)}) {_AXIS_NAMES[axis]}")
        panels[1, number].set_xlabel("preset distance (cm)")
    panels[0, 0].set_ylabel("measured - preset\ndistance (mm)")
    panels[1, 0].set_ylabel("sensing - reference\n(% of reference)")
    handles = panels[0, 0].get_legend_handles_labels()[0] + panels[1, 0].get_legend_handles_labels()[0]
    handles.append(Line2D([], [], color="0.35", label="standard deviation of drives"))
    legend_below(figure, handles, 5)
    figure.suptitle(title)
    return save_figure(figure, path)


def _curve_panel(axes: Axes, fit: AxisFit) -> None:
    rotations = [point.rotation_rad for point in fit.points]
    travels = np.array([point.travel for point in fit.points])
    driven = np.linspace(0.0, 1.03 * travels[-1], 200)
    turned = Polynomial(fit.curve)(driven)
    shown = turned >= 0.0
    axes.plot(turned[shown], driven[shown] * _CM, color=BLUE, linewidth=1.4, label="fitted curve", zorder=2)
    axes.plot(rotations, travels * _CM, "o", markersize=4, color="black", label="mean of drives", zorder=3)
    _tidy(axes)


def _residual_panel(axes: Axes, fit: AxisFit) -> None:
    rotations = [point.rotation_rad for point in fit.points]
    errors = [point.scatter / np.sqrt(point.drives) * _MM for point in fit.points]
    axes.axhline(0.0, color=BLUE, linewidth=1.2)
    axes.errorbar(
        rotations,
        [point.residual * _MM for point in fit.points],
        errors,
        fmt="o",
        markersize=4,
        color="0.35",
        capsize=2,
        label="residual with the mean's standard error",
    )
    _tidy(axes)


def _percentage_bars(panel: Axes, rows: Sequence[DistanceComparison]) -> None:
    presets, step = _presets(rows)
    panel.bar(
        presets,
        [row.difference.mean * 100.0 for row in rows],
        0.5 * step,
        yerr=[row.difference.std * 100.0 for row in rows],
        color="0.75",
        error_kw={"ecolor": "0.35", "elinewidth": 1.0, "capsize": 2},
        label="sensing - reference",
    )
    panel.axhline(0.0, color=BLACK, linewidth=0.8)
    _tidy(panel)


def _distances(panel: Axes, rows: Sequence[DistanceComparison]) -> None:
    """Draw means with the standard deviation of single drives, side by side."""
    presets, step = _presets(rows)
    series = (  # colours as in the paper's figure
        ("motor encoders", "motor_m", BLUE, "s"),
        ("sensing wheels", "sensing_m", VERMILION, "o"),
        ("one-point reference", "reference_m", GREEN, "^"),
    )
    for number, (label, name, colour, marker) in enumerate(series):
        found = [getattr(row, name) for row in rows]
        panel.errorbar(
            presets + (number - 1) * 0.2 * step,
            (np.array([spread.mean for spread in found]) * _CM - presets) * 10.0,
            [spread.std * _MM for spread in found],
            fmt=marker,
            color=colour,
            markersize=4.5,
            elinewidth=1.0,
            label=label,
        )
    panel.axhline(0.0, color=BLACK, linewidth=0.8)
    panel.set_xticks(presets)
    _tidy(panel)


def _presets(rows: Sequence[DistanceComparison]) -> tuple[Any, float]:
    """Return the preset distances and their step, cm."""
    presets = np.array([row.preset_m for row in rows]) * _CM
    return presets, float(np.diff(presets).min()) if len(presets) > 1 else 1.0


def _tidy(axes: Axes) -> None:
    axes.grid()
