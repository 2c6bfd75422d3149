"""Pictures of calibrations: the motors' curves with their residuals, and three instruments' distances compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Polynomial

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.calibration.encoder_comparison import DistanceComparison
from robot_formation.calibration.motor_fit import AxisFit
from robot_formation.names import LEADER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette; blue, red and green as in the paper's figure.
_BLUE, _RED, _GREEN, _GREY = "#0072B2", "#D55E00", "#009E73", "0.80"
_CM, _MM = 100.0, 1000.0
_AXIS_NAMES = {"v": "along v", "u": "along u"}
_PANEL_WIDTH = 3.6


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
        axes[0, column].set_title(f"({chr(ord('a') + column)}) {name}, {_AXIS_NAMES[axis]}", fontsize=10)
        axes[1, column].set_xlabel("wheel rotation (rad)")
        axes[1, column].autoscale(axis="x")
    axes[0, 0].set_ylabel("travelled distance (cm)")
    axes[1, 0].set_ylabel("measured -\ncurve (mm)")
    handles = axes[0, 0].get_legend_handles_labels()[0] + axes[1, 0].get_legend_handles_labels()[0]
    legend_below(figure, handles, 3, fontsize=9)
    figure.suptitle(title, fontsize=12)
    return save_figure(figure, path)


def draw_encoders(comparisons: Sequence[DistanceComparison], title: str, path: str | Path) -> Path:
    """Draw the distances that three instruments measured, and grey bars of sensing against reference (paper).

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(9.6, 4.4)
    panels = figure.subplots(1, 2)
    highest = max(abs(row.difference.mean) + row.difference.std for row in comparisons) * 100.0
    for number, (axis, panel) in enumerate(zip(("v", "u"), panels, strict=True)):
        rows = [row for row in comparisons if row.axis == axis]
        bars = _percentage_bars(panel, rows, highest)
        _distances(panel, rows)
        panel.set_title(f"({chr(ord('a') + number)}) {_AXIS_NAMES[axis]}", fontsize=10)
        panel.set(xlabel="preset distance (cm)", ylabel="measured distance (cm)")
        bars.set_ylabel("sensing - reference (% of reference)", color="0.35")
    handles = panels[0].get_legend_handles_labels()[0] + bars.get_legend_handles_labels()[0]
    legend_below(figure, handles, 4, fontsize=9)
    figure.suptitle(title, fontsize=12)
    return save_figure(figure, path)


def _curve_panel(axes: Axes, fit: AxisFit) -> None:
    rotations = [point.rotation_rad for point in fit.points]
    travels = np.array([point.travel for point in fit.points])
    driven = np.linspace(0.0, 1.03 * travels[-1], 200)
    turned = Polynomial(fit.curve)(driven)
    shown = turned >= 0.0
    axes.plot(turned[shown], driven[shown] * _CM, color=_BLUE, linewidth=1.4, label="fitted curve", zorder=2)
    axes.plot(rotations, travels * _CM, "o", markersize=4, color="black", label="mean of drives", zorder=3)
    _tidy(axes)


def _residual_panel(axes: Axes, fit: AxisFit) -> None:
    rotations = [point.rotation_rad for point in fit.points]
    errors = [point.scatter / np.sqrt(point.drives) * _MM for point in fit.points]
    axes.axhline(0.0, color=_BLUE, linewidth=1.2)
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


def _percentage_bars(panel: Axes, rows: Sequence[DistanceComparison], highest: float) -> Any:
    """Draw the bars on an axis of their own, behind; its zero lies at mid-height so that bars may point down."""
    bars = panel.twinx()
    bars.set_zorder(panel.get_zorder() - 1)
    panel.patch.set_visible(False)
    presets = np.array([row.preset_m for row in rows]) * _CM
    width = 0.5 * float(np.diff(presets).min()) if len(presets) > 1 else 0.5
    bars.bar(
        presets,
        [row.difference.mean * 100.0 for row in rows],
        width,
        yerr=[row.difference.std * 100.0 for row in rows],
        color=_GREY,
        error_kw={"ecolor": "0.6", "elinewidth": 1.0},
        label="sensing - reference",
    )
    bars.axhline(0.0, color="0.6", linewidth=0.8)
    bars.set_ylim(-1.1 * highest, 1.1 * highest)
    bars.tick_params(axis="y", colors="0.35")
    bars.spines["top"].set_visible(False)
    return bars


def _distances(panel: Axes, rows: Sequence[DistanceComparison]) -> None:
    presets = np.array([row.preset_m for row in rows]) * _CM
    step = float(np.diff(presets).min()) if len(presets) > 1 else 1.0
    series = (
        ("motor encoders", "motor_m", _BLUE, "s"),
        ("sensing wheels", "sensing_m", _RED, "o"),
        ("one-point reference", "reference_m", _GREEN, "^"),
    )
    for number, (label, name, colour, marker) in enumerate(series):
        means = np.array([getattr(row, name).mean for row in rows]) * _CM
        # Side by side: the three differ by less than a marker's size.
        panel.plot(
            presets + (number - 1) * 0.16 * step,
            means,
            color=colour,
            marker=marker,
            markersize=4.5,
            linestyle="none",
            label=label,
        )
    panel.set_ylim(bottom=0.0)
    panel.set_xticks(presets)
    _tidy(panel)


def _tidy(axes: Axes) -> None:
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top"]].set_visible(False)
