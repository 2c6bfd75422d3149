"""Pictures of the camera's curves: column against v at several distances, and side length against u."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_formation.analysis.plotting import new_figure, save_figure
from robot_formation.analysis.style import BAND, PALETTE, styled
from robot_formation.calibration.camera_fit import WINDOW_M, CameraFit, FaceView, difference_px
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
_COLOURS = PALETTE  # blue, orange and green as in the paper's figure, then further ones
_RED = "#C00000"
_SHOWN_M = 0.105


@styled
def draw_pan(
    fit: CameraFit,
    views: Sequence[FaceView],
    distances_m: Sequence[float],
    compared_m: Sequence[float],
    title: str,
    path: str | Path,
) -> Path:
    """Draw the column of the Target block against v at several distances, and how much these differ.

    Args:
        fit: the curves.
        views: what was measured.
        distances_m: distances u that are drawn.
        compared_m: those of them whose columns are compared.
        title: over the picture.
        path: of the picture.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(7.6, 6.6)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": (3, 1.2)})
    v = np.linspace(-_SHOWN_M, _SHOWN_M, 100)
    for colour, u in zip(_COLOURS, distances_m, strict=False):
        own = [view for view in views if abs(view.u_m - u) < 1e-9 and abs(view.v_m) <= _SHOWN_M]
        upper.plot(v * _CM, fit.column(u, v), color=colour, linewidth=1.0)
        upper.plot(
            [view.v_m * _CM for view in own],
            [view.box.x for view in own],
            "o",
            color=colour,
            markersize=3,
            label=f"u = {u * _CM:g} cm",
        )
    upper.plot([], [], color="0.3", linewidth=1.0, label="fitted curves")
    low, high = fit.window_px()
    for column in (low, high):
        upper.axhline(column, color="0.45", linestyle=":", linewidth=1.2)
    for panel in (upper, lower):
        panel.axvspan(-WINDOW_M * _CM, WINDOW_M * _CM, color=BAND, zorder=0)
    upper.plot([], [], color="0.45", linestyle=":", label=f"fine-tuning window, {low:.0f} to {high:.0f} px")
    upper.set_ylabel("column of the Target block (px)")
    upper.legend()
    _differences(lower, fit, views, compared_m, v)
    lower.set_xlabel("v, follower ahead of its neighbour (cm)")
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


def _differences(axes: Axes, fit: CameraFit, views: Sequence[FaceView], compared_m: Sequence[float], v: Any) -> None:
    measured = {place: px for place, px in difference_px(views, compared_m).items() if abs(place) <= _SHOWN_M}
    columns = np.array([fit.column(u, v) for u in compared_m])
    axes.plot(v * _CM, np.ptp(columns, axis=0), color=_RED, linewidth=1.0, label="fitted")
    axes.plot(
        [place * _CM for place in measured],
        list(measured.values()),
        "o:",
        color=_RED,
        markersize=3,
        linewidth=1.0,
        label="measured",
    )
    ends = f"u = {min(compared_m) * _CM:g} to {max(compared_m) * _CM:g} cm"
    axes.set_ylabel("largest\ndifference (px)")
    axes.set_ylim(bottom=0.0)
    axes.legend(title=ends, title_fontsize=9, loc="upper center", ncols=2)


@styled
def draw_side(fit: CameraFit, views: Sequence[FaceView], tolerance_m: float, title: str, path: str | Path) -> Path:
    """Draw width, height and the longer side of the Target block against u, straight beside the neighbour.

    Args:
        fit: the curves.
        views: what was measured.
        tolerance_m: of the fine-tuner along u, shown about the formation distance.
        title: over the picture.
        path: of the picture.

    Raises:
        AnalysisError: the file can't be written.
    """
    beside = [view for view in views if view.v_m == 0.0]
    u = np.array([view.u_m for view in beside])
    sides = np.array([view.box.side for view in beside])
    figure = new_figure(7.2, 5.6)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": (3, 1)})
    shown = np.linspace(u.min(), u.max(), 200)
    upper.plot(shown * _CM, fit.side(shown), color=_COLOURS[0], linewidth=1.3, label="fitted curve of the longer side")
    upper.plot(u * _CM, [view.box.width for view in beside], "s", color=_COLOURS[1], markersize=4, label="width")
    upper.plot(u * _CM, [view.box.height for view in beside], "^", color=_COLOURS[2], markersize=3.5, label="height")
    at = float(fit.side(FORMATION_DISTANCE_M))
    upper.plot(FORMATION_DISTANCE_M * _CM, at, "+", color="black", markersize=12, label=f"formation, {at:.1f} px")
    lower.axhline(0.0, color=_COLOURS[0], linewidth=1.2)
    lower.plot(u * _CM, sides - fit.side(u), "o", color="0.35", markersize=3.5)
    for panel in (upper, lower):
        panel.axvspan(
            (FORMATION_DISTANCE_M - tolerance_m) * _CM,
            (FORMATION_DISTANCE_M + tolerance_m) * _CM,
            color=BAND,
            zorder=0,
        )
    upper.set_ylabel("side length as reported (px)")
    lower.set_ylabel("longer side\n- curve (px)")
    lower.set_xlabel(f"u (cm); grey: tolerance of {tolerance_m * _CM:g} cm about the formation distance")
    upper.legend()
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)
