"""Picture of one-step forecasts over a displacement log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.displacement_log import DisplacementLog
from robot_formation.analysis.forecasts import OneStepForecasts
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantiles import NORMAL_90
from robot_formation.analysis.style import PALETTE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = PALETTE[:3]
MOST_DRAWN = len(_COLOURS)
"""Predictors that one picture has room for."""

_AXES = ("u, to the right", "v, forward")
_CM = 100.0
_MANY = 60  # timesteps from which on single marks would run into each other


@styled
def draw_forecasts(
    log: DisplacementLog, forecasts: Sequence[OneStepForecasts], path: str | Path, best: str | None = None
) -> Path:
    """Draw forecasts with their 90 % bands over what came: a column per predictor, u above v.

    Args:
        log: the log.
        forecasts: of 1 to `MOST_DRAWN` predictors.
        path: file to write; an older picture there is replaced.
        best: name of the predictor that is marked as the one with the least error.

    Raises:
        AnalysisError: the file can't be written.
    """
    columns = len(forecasts)
    figure = new_figure(max(7.2, 1.0 + 3.8 * columns), 5.6)
    panels = figure.subplots(2, columns, sharex=True, sharey="row", squeeze=False)
    for column, (forecast, colour) in enumerate(zip(forecasts, _COLOURS, strict=False)):
        marked = forecast.name == best
        title = f"{forecast.name} (least RMSE)" if marked else forecast.name
        panels[0, column].set_title(title, fontsize=11, fontweight="bold" if marked else "normal")
        for row in range(2):
            _panel(panels[row, column], log.targets_m[:, row], forecast, row, colour)
        panels[1, column].set_xlabel("timestep")
    for row, name in enumerate(_AXES):
        panels[row, 0].set_ylabel(f"{name} (cm)")
        _limit(panels[row, 0], log.targets_m[:, row], forecasts, row)
    _legend(figure, "ideal move" if log.has_residuals else "displacement")
    figure.suptitle(f"{Path(log.source).name}: one-step forecasts", fontsize=12)
    return save_figure(figure, path)


def _panel(axes: Axes, target_m: NDArray[np.float64], forecast: OneStepForecasts, row: int, colour: str) -> None:
    from matplotlib.ticker import MaxNLocator

    numbers = np.arange(1, len(target_m) + 1)
    mean = forecast.means_m[:, row] * _CM
    low, high = _band_cm(forecast, row)
    many = len(numbers) > _MANY
    axes.fill_between(numbers, low, high, color=colour, alpha=0.22, linewidth=0)
    axes.plot(numbers, mean, color=colour, linewidth=1.6, marker="" if many else "o", markersize=3.5)
    axes.plot(
        numbers, target_m * _CM, linestyle="none", marker="o", markersize=1.6 if many else 4, color="black", zorder=4
    )
    axes.set_xlim(0.5, len(numbers) + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 2.5, 5, 10], integer=True))
    axes.grid()


def _band_cm(forecast: OneStepForecasts, row: int) -> NDArray[np.float64]:
    half = NORMAL_90 * np.sqrt(forecast.covariances_m2[:, row, row])
    return np.stack([forecast.means_m[:, row] - half, forecast.means_m[:, row] + half]) * _CM


def _limit(axes: Axes, target_m: NDArray[np.float64], forecasts: Sequence[OneStepForecasts], row: int) -> None:
    """Show every mark, and bands as far as they don't make all else flat."""
    marks = np.concatenate([target_m, *(forecast.means_m[:, row] for forecast in forecasts)]) * _CM
    low, high = float(np.nanmin(marks)), float(np.nanmax(marks))
    span = high - low
    bands = np.concatenate([marks, *(_band_cm(forecast, row).ravel() for forecast in forecasts)])
    margin = 0.04 * span + 0.1
    axes.set_ylim(max(low - span, float(np.nanmin(bands))) - margin, min(high + span, float(np.nanmax(bands))) + margin)


def _legend(figure: Figure, target: str) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color="black", linestyle="none", marker="o", markersize=4, label=target),
        Line2D([], [], color="0.45", linewidth=1.6, label="forecast from the timesteps before"),
        Patch(color="0.45", alpha=0.3, linewidth=0, label="its 90 % band"),
    ]
    legend_below(figure, handles, len(handles))
