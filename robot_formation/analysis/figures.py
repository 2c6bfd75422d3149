"""Pictures of a run: the trajectories over contour lines, and the corrections per timestep.

Matplotlib is imported when a picture is drawn, and draws without a display (Agg).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantities import Corrections, FollowerAnalysis, RunAnalysis
from robot_formation.analysis.run_record import Ground, RunRecord, Track
from robot_formation.names import LEADER
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette, safe for colour-blind readers; leader orange and follower blue as in the paper's figures.
_LEADER_COLOUR = "#E69F00"
_FOLLOWER_COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#56B4E9")
_U_COLOUR, _V_COLOUR = "#CC79A7", "#009E73"
_LOST_COLOUR = "#D00000"
_CM = 100.0
_FLAT_M = 1e-6


def draw_trajectory(record: RunRecord, analysis: RunAnalysis, path: str | Path) -> Path:
    """Draw the robots' true paths from above over the ground's contour lines (paper, figure of trajectories).

    Args:
        record: the run; without ground no contour lines are drawn, without tracks only the frame.
        analysis: the same run's quantities.
        path: file to write; an older picture there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure, axes = _figure(7.2, 6.6)
    if record.ground is not None:
        _contours(axes, record.ground)
    stops = {follower.name: [d.stamp_ns for d in follower.displacements] for follower in record.followers}
    stops[LEADER] = [move.stamp_ns for move in record.leader_moved]
    for number, robot in enumerate(record.tracks):
        colour = _LEADER_COLOUR if robot == LEADER else _FOLLOWER_COLOURS[(number - 1) % len(_FOLLOWER_COLOURS)]
        _path(axes, record.tracks[robot], stops.get(robot, []), colour, robot.replace("_", " "))
    seen = [track.seen_m[:, :2] for track in record.overhead.values()]
    if seen:
        style = {"color": "black", "markersize": 5, "markeredgewidth": 0.7}
        _mark(axes, list(np.concatenate(seen)), marker="+", label="seen from above (dot)", **style)
    _ends(axes, record, analysis)
    # Contour lines end at the plate's edges, which then are the picture's.
    axes.margins(0.1 if record.ground is None else 0.0)
    axes.set(xlabel="x (cm)", ylabel="y (cm)", aspect="equal", title=_title(record, analysis))
    legend_below(figure, axes.get_legend_handles_labels()[0], 6, fontsize=9, columnspacing=1.4)
    return save_figure(figure, path)


def draw_corrections(record: RunRecord, analysis: RunAnalysis, path: str | Path) -> Path:
    """Draw each timestep's correction distance, u on v, one panel per follower (paper, figure of comparison).

    Args:
        record: the run.
        analysis: the same run's quantities.
        path: file to write; an older picture there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure, panels = _figure(8.0, 1.2 + 2.8 * len(analysis.followers), rows=len(analysis.followers))
    for axes, follower in zip(np.atleast_1d(panels), analysis.followers, strict=True):
        _bars(axes, follower, record.timesteps_planned)
        axes.set_ylabel("correction distance (cm)")
        total = follower.totals["correction_m"]
        said = "" if total is None else f": {total * _CM:.1f} cm from timestep {COLLECTION_TIMESTEPS + 1} on"
        axes.set_title(f"{follower.name.replace('_', ' ')}{said}", loc="left", fontsize=10)
    np.atleast_1d(panels)[-1].set_xlabel("timestep")
    handles, _ = np.atleast_1d(panels)[0].get_legend_handles_labels()
    legend_below(figure, handles, len(handles))
    figure.suptitle(_title(record, analysis), fontsize=12)
    return save_figure(figure, path)


def _figure(width: float, height: float, rows: int = 1) -> tuple[Any, Any]:
    figure = new_figure(width, height)
    return figure, figure.subplots(rows, 1, sharex=True)


def _contours(axes: Axes, ground: Ground) -> None:
    from matplotlib.tri import Triangulation

    x, y, z = ground.vertices_m.T
    axes.update_datalim(ground.vertices_m[:, :2] * _CM)
    if np.ptp(z) < _FLAT_M:
        return
    mesh = Triangulation(x * _CM, y * _CM, ground.triangles)
    lines = axes.tricontour(mesh, z * 1e3, levels=9, colors="0.65", linewidths=0.8)
    axes.clabel(lines, fmt="%g", fontsize=7)
    axes.plot([], [], color="0.65", linewidth=0.8, label="height (mm)")


def _path(axes: Axes, track: Track, stops_ns: list[int], colour: str, label: str) -> None:
    xy = track.positions_m[:, :2] * _CM
    axes.plot(*xy.T, color=colour, linewidth=1.8, label=label, zorder=3)
    at_rest = [(pose.x_m * _CM, pose.y_m * _CM) for stamp in stops_ns if (pose := track.at(stamp)) is not None]
    if at_rest:
        axes.plot(*np.array(at_rest).T, ".", color=colour, markersize=6, zorder=3)


def _ends(axes: Axes, record: RunRecord, analysis: RunAnalysis) -> None:
    """Mark where each robot started and stopped, and where a follower lost its neighbour."""
    lost = {follower.name for follower in analysis.followers if follower.lost}
    starts = [track.positions_m[0, :2] for track in record.tracks.values()]
    ends = [track.positions_m[-1, :2] for robot, track in record.tracks.items() if robot not in lost]
    crosses = [track.positions_m[-1, :2] for robot, track in record.tracks.items() if robot in lost]
    outline = {"markerfacecolor": "white", "markeredgecolor": "black", "markersize": 7}
    _mark(axes, starts, marker="o", label="start", **outline)
    _mark(axes, ends, marker="s", label="end", **outline)
    _mark(axes, crosses, marker="x", label="lost", color=_LOST_COLOUR, markersize=11, markeredgewidth=3.0)


def _mark(axes: Axes, points_m: list[NDArray[np.float64]], **style: Any) -> None:
    if points_m:
        axes.plot(*(np.array(points_m) * _CM).T, linestyle="none", zorder=4, **style)


def _bars(axes: Axes, follower: FollowerAnalysis, planned: int | None) -> None:
    numbers = [timestep.t for timestep in follower.timesteps]
    rows = [timestep.corrections for timestep in follower.timesteps]
    last = max(planned or 0, len(numbers) + (follower.unfinished is not None), COLLECTION_TIMESTEPS + 1)
    axes.axvspan(0.5, COLLECTION_TIMESTEPS + 0.5, color="0.92", zorder=0, label="collection phase")
    _stack(axes, numbers, _components(rows), 1.0)
    if follower.unfinished is not None:
        t = len(numbers) + 1
        _stack(axes, [t], _components([follower.unfinished]), 0.45)
        height = (follower.unfinished.u_m + follower.unfinished.v_m) * _CM
        word = "lost" if follower.lost else "unfinished"
        axes.annotate(word, (t, height), (0, 3), textcoords="offset points", ha="center", fontsize=8)
    axes.set(xlim=(0.5, last + 0.5), xticks=range(1, last + 1))
    axes.margins(y=0.12)
    axes.grid(axis="y", color="0.85", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _components(rows: list[Corrections]) -> NDArray[np.float64]:
    return np.array([(row.u_m, row.v_m) for row in rows]).reshape(-1, 2) * _CM


def _stack(axes: Axes, numbers: list[int], uv_cm: NDArray[np.float64], alpha: float) -> None:
    labelled = alpha == 1.0
    draw = partial(axes.bar, numbers, edgecolor="white", linewidth=0.5, width=0.72, alpha=alpha)
    draw(uv_cm[:, 1], color=_V_COLOUR, label="v (forward)" if labelled else None)
    label = "u (lateral)" if labelled else None
    draw(uv_cm[:, 0], bottom=uv_cm[:, 1], color=_U_COLOUR, hatch="///", label=label)


def _title(record: RunRecord, analysis: RunAnalysis) -> str:
    details = record.details
    parts = [analysis.scenario or "formation run"]
    parts += [f"{details['predictor']} predictor"] if details.get("predictor") else []
    parts += [f"seed {details['seed']}"] if details.get("seed") else []
    parts += [analysis.outcome] if analysis.outcome != "done" else []
    return " · ".join(parts)
