"""Pictures of a run: the trajectories over contour lines, and the corrections per timestep.

Matplotlib is imported when a picture is drawn, and draws without a display (Agg).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.chain import pose, pose_at_end
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantities import Corrections, FollowerAnalysis, RunAnalysis
from robot_formation.analysis.run_record import FollowerRecord, Ground, RunRecord
from robot_formation.analysis.style import (
    BAND,
    BLACK,
    LOST_COLOUR,
    U_COLOUR,
    V_COLOUR,
    robot_colour,
    styled,
)
from robot_formation.geometry.se2 import Motion
from robot_formation.names import beacon_neighbour
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
_FLAT_M = 1e-6
_MARGIN_CM = 24.0  # around the paths: a robot, standing in whatever direction, and some ground
_LABEL_ROOM_CM = 5.0
_CONTOUR_COLOUR = "0.70"


@styled
def draw_trajectory(record: RunRecord, analysis: RunAnalysis, path: str | Path, *, overhead: bool = False) -> Path:
    """Draw the robots' true paths from above over contour lines, and below the formation error of each timestep.

    Args:
        record: the run; without ground no contour lines are drawn, without tracks only the frame.
        analysis: the same run's quantities.
        path: file to write; an older picture there is replaced.
        overhead: whether to mark where the overhead tracker saw the reference dots.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(7.2, 8.4)
    above, below = figure.subplots(2, 1, height_ratios=(4, 1))
    trajectory_panel(above, record, analysis, overhead=overhead)
    for follower in analysis.followers:
        errors = [(t.t, t.formation_error_m * _CM) for t in follower.timesteps if t.formation_error_m is not None]
        colour = robot_colour(follower.name)
        below.plot(*np.array(errors).reshape(-1, 2).T, "o-", color=colour, markersize=4, linewidth=1.2)
    timestep_axis(below, planned_timesteps(record, analysis))
    below.set(xlabel="timestep", ylabel="formation\nerror (cm)")
    below.set_title(rmse_text(analysis), loc="right", fontsize=9)
    below.set_ylim(bottom=0.0)
    figure.suptitle(run_title(record, analysis))
    legend_below(figure, above.get_legend_handles_labels()[0], 5, columnspacing=1.4)
    return save_figure(figure, path)


@styled
def draw_corrections(record: RunRecord, analysis: RunAnalysis, path: str | Path) -> Path:
    """Draw each timestep's correction distance, u on v, one panel per follower and one scale for all.

    Args:
        record: the run.
        analysis: the same run's quantities.
        path: file to write; an older picture there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    rows = len(analysis.followers)
    figure = new_figure(8.0, 1.2 + 2.6 * rows)
    panels = figure.subplots(rows, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, follower in zip(panels, analysis.followers, strict=True):
        corrections_panel(axes, record, analysis, follower)
    highest = max(axes.dataLim.y1 for axes in panels)
    panels[0].set_ylim(0.0, 1.15 * max(highest, 0.1))
    panels[-1].set_xlabel("timestep")
    handles, _ = panels[0].get_legend_handles_labels()
    legend_below(figure, handles, len(handles))
    figure.suptitle(run_title(record, analysis))
    return save_figure(figure, path)


def trajectory_panel(
    axes: Axes, record: RunRecord, analysis: RunAnalysis, *, overhead: bool = False, whole_plate: bool = False
) -> None:
    """Draw a run from above into axes in centimetres of the world.

    Args:
        axes: what to draw into; its entries for a legend are labelled.
        record: the run.
        analysis: the same run's quantities.
        overhead: whether to mark where the overhead tracker saw the reference dots.
        whole_plate: whether to show all of the ground, not only what is around the paths.
    """
    _limits(axes, record, whole_plate=whole_plate)
    if record.ground is not None:
        _contours(axes, record.ground, [track.positions_m[:, :2] for track in record.tracks.values()])
    size = 0.6 if whole_plate else 1.0
    for robot in record.tracks:
        _path(axes, record, robot, size)
    _places(axes, record, size)
    axes.plot([], [], ":", color="0.4", linewidth=1.0, label="body at the start")
    axes.plot([], [], "s", color="0.75", markersize=9, label="body at the end")
    seen = [track.seen_m[:, :2] for track in record.overhead.values()]
    if overhead and seen:
        style = {"color": BLACK, "markersize": 5, "markeredgewidth": 0.7}
        _mark(axes, np.concatenate(seen), marker="+", label="dot as seen from above", **style)
    lost = {follower.name for follower in analysis.followers if follower.lost}
    ends = [track.positions_m[-1, :2] for robot, track in record.tracks.items() if robot in lost]
    _mark(axes, ends, marker="x", label="lost", color=LOST_COLOUR, markersize=11, markeredgewidth=3.0)
    axes.set(xlabel="x (cm)", ylabel="y (cm)", aspect="equal")
    axes.spines[["top", "right"]].set_visible(True)


def corrections_panel(axes: Axes, record: RunRecord, analysis: RunAnalysis, follower: FollowerAnalysis) -> None:
    """Draw a follower's correction distance in each timestep of a run, centimetres, u on v, with its sum as title."""
    timestep_axis(axes, planned_timesteps(record, analysis))
    correction_bars(axes, follower)
    axes.set_ylabel("correction distance (cm)")
    total = follower.totals["correction_m"]
    said = "" if total is None else f": {total * _CM:.1f} cm from timestep {COLLECTION_TIMESTEPS + 1} on"
    axes.set_title(f"{follower.name.replace('_', ' ')}{said}", loc="left")


def correction_bars(axes: Axes, follower: FollowerAnalysis) -> None:
    """Draw a follower's correction distances per timestep in cm, u on v; a timestep without any has a small circle."""
    numbers = [timestep.t for timestep in follower.timesteps]
    rows = [timestep.corrections for timestep in follower.timesteps]
    _stack(axes, numbers, _components(rows), 1.0)
    without = [t for t, row in zip(numbers, rows, strict=True) if row.u_m + row.v_m == 0.0]
    if without:
        style: dict[str, Any] = {
            "markerfacecolor": "white",
            "markeredgecolor": "0.35",
            "markersize": 4,
            "clip_on": False,
        }
        axes.plot(without, [0.0] * len(without), "o", label="no correction", zorder=3, **style)
    if follower.unfinished is not None:
        t = len(numbers) + 1
        _stack(axes, [t], _components([follower.unfinished]), 0.45)
        height = (follower.unfinished.u_m + follower.unfinished.v_m) * _CM
        word = "lost" if follower.lost else "unfinished"
        axes.annotate(word, (t, height), (0, 3), textcoords="offset points", ha="center", fontsize=8)
    axes.grid(axis="y")


def timestep_axis(axes: Axes, last: int, label: str = "collection phase") -> None:
    """Make the x axis one of timesteps from 1 to the last, with the collection phase in grey.

    Args:
        axes: whose axis it is.
        last: timestep.
        label: of the grey in a legend; '': none.
    """
    from matplotlib.ticker import MaxNLocator

    axes.axvspan(0.5, COLLECTION_TIMESTEPS + 0.5, color=BAND, zorder=0, linewidth=0, label=label)
    axes.set_xlim(0.5, last + 0.5)
    if last <= 25:
        axes.set_xticks(range(1, last + 1))
    else:
        axes.xaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], integer=True))


def planned_timesteps(record: RunRecord, analysis: RunAnalysis) -> int:
    """Return how many timesteps a figure of the run has room for: those planned, or that there were."""
    begun = [len(f.timesteps) + (f.unfinished is not None) for f in analysis.followers]
    return max(record.timesteps_planned or 0, *begun, COLLECTION_TIMESTEPS + 1)


def run_title(record: RunRecord, analysis: RunAnalysis) -> str:
    """Return a run in a line: scenario, surface, predictor, seed, and the outcome if it isn't 'done'."""
    details = record.details
    parts = [(analysis.scenario or "formation run").replace("_", " ")]
    parts += [details["surface"]] if details.get("surface") else []
    parts += [f"{details['predictor']} predictor"] if details.get("predictor") else []
    parts += [f"seed {details['seed']}"] if details.get("seed") else []
    parts += [analysis.outcome.replace("_", " ")] if analysis.outcome != "done" else []
    return " · ".join(parts)


def rmse_text(analysis: RunAnalysis) -> str:
    """Return each follower's RMSE in a line; empty where none is known."""
    known = [(f.name.replace("_", " "), f.totals["formation_error_rmse_m"]) for f in analysis.followers]
    said = [f"{name}: {rmse * _CM:.2f} cm" for name, rmse in known if rmse is not None]
    return f"RMSE {', '.join(said)}" if len(known) > 1 and said else "".join(said).replace(known[0][0] + ":", "RMSE")


def _limits(axes: Axes, record: RunRecord, *, whole_plate: bool) -> None:
    """Show the ground, or a square of it about the paths."""
    ground = None if record.ground is None else record.ground.vertices_m[:, :2] * _CM
    tracks = [track.positions_m[:, :2] * _CM for track in record.tracks.values()]
    if ground is not None and (whole_plate or not tracks):
        (left, low), (right, high) = ground.min(axis=0), ground.max(axis=0)
    elif tracks:
        ends = np.concatenate(tracks)
        middle = 0.5 * (ends.min(axis=0) + ends.max(axis=0))
        half = 0.5 * float(np.ptp(ends, axis=0).max()) + _MARGIN_CM
        (left, low), (right, high) = middle - half, middle + half
    else:
        return
    axes.set(xlim=(left, right), ylim=(low, high))


def _contours(axes: Axes, ground: Ground, paths_m: Sequence[NDArray[np.float64]]) -> None:
    from matplotlib.tri import Triangulation

    x, y, z = ground.vertices_m.T * np.array([[_CM], [_CM], [1e3]])
    corners = (x.min(), y.min()), (x.max(), y.max())
    axes.plot(*_rectangle(*corners), color="0.25", linewidth=1.0, scalex=False, scaley=False)
    if np.ptp(z) < _FLAT_M * 1e3:
        return
    lines = axes.tricontour(Triangulation(x, y, ground.triangles), z, levels=9, colors=_CONTOUR_COLOUR, linewidths=0.8)
    axes.plot([], [], color=_CONTOUR_COLOUR, linewidth=0.8, label="height (mm)")
    ways = np.concatenate([path * _CM for path in paths_m]) if paths_m else np.empty((0, 2))
    for level, segments in zip(lines.levels, lines.allsegs, strict=True):
        inside = [segment[_inside(segment, corners, _LABEL_ROOM_CM)] for segment in segments if len(segment)]
        place = _free_place(axes, inside, ways)
        if place is not None:
            ways = np.vstack([ways, place])
            box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            axes.text(
                place[0],
                place[1],
                f"{level:g}",
                fontsize=7,
                color="0.4",
                ha="center",
                va="center",
                bbox=box,
                zorder=2.5,
            )


def _free_place(
    axes: Axes, lines: Sequence[NDArray[np.float64]], ways: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return where on a contour line its label is farthest from all ways and labels (n, 2); None without room."""
    room = _LABEL_ROOM_CM
    points = np.concatenate(lines) if lines else np.empty((0, 2))
    points = points[_inside(points, np.array([axes.get_xlim(), axes.get_ylim()]).T, 0.6 * room)]
    if not len(points):
        return None
    if not len(ways):
        return np.asarray(points[0])
    distances = np.hypot(*(points[:, None] - ways[None]).transpose(2, 0, 1)).min(axis=1)
    best = int(np.argmax(distances))
    return np.asarray(points[best]) if distances[best] > room else None


def _inside(points: NDArray[np.float64], corners: Any, margin: float) -> NDArray[np.bool_]:
    """Return which points (n, 2) lie between the two corners, a margin away from the edges."""
    low, high = corners
    return np.asarray(np.all((points > np.add(low, margin)) & (points < np.subtract(high, margin)), axis=1))


def _rectangle(low: Sequence[float], high: Sequence[float]) -> tuple[list[float], list[float]]:
    return [low[0], high[0], high[0], low[0], low[0]], [low[1], low[1], high[1], high[1], low[1]]


def _path(axes: Axes, record: RunRecord, robot: str, size: float) -> None:
    """Draw a robot's way with its direction, a dot where it ended each timestep, and its body at start and end."""
    track, colour = record.tracks[robot], robot_colour(robot)
    xy = track.positions_m[:, :2] * _CM
    axes.plot(*xy.T, color=colour, linewidth=1.6, label=robot.replace("_", " "), zorder=3)
    follower = next((found for found in record.followers if found.name == robot), None)
    ends = record.leader_moved if follower is None else follower.displacements
    at_rest = [(p.x_m * _CM, p.y_m * _CM) for end in ends if (p := track.at(end.stamp_ns)) is not None]
    stops = np.array(at_rest).reshape(-1, 2)
    axes.plot(*stops.T, "o", color=colour, markersize=3.5 * size, zorder=3)
    for index, style in ((0, {"facecolor": "none", "linestyle": ":"}), (-1, {"facecolor": colour, "alpha": 0.22})):
        x_m, y_m = track.positions_m[index, :2].tolist()
        _body(axes, record, Motion(x_m, y_m, float(track.yaws_rad[index])), colour, style)
    _arrow(axes, stops, colour, size)


def _body(axes: Axes, record: RunRecord, where: Motion, colour: str, style: dict[str, Any]) -> None:
    from matplotlib.patches import Polygon

    half_length, half_width = (0.5 * side * _CM for side in record.body_m)
    corners = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (half_length, half_width)
    cosine, sine = math.cos(where.yaw_rad), math.sin(where.yaw_rad)
    placed = corners @ np.array([(cosine, sine), (-sine, cosine)]) + (where.x_m * _CM, where.y_m * _CM)
    axes.add_patch(Polygon(placed, edgecolor=colour, linewidth=0.9, zorder=2, **style))


def _arrow(axes: Axes, stops: NDArray[np.float64], colour: str, size: float) -> None:
    """Point along the way, from one stop (n, 2) to the next, a third of them from the start."""
    if len(stops) < 2:
        return
    tail, head = stops[(len(stops) - 2) // 3 :][:2]
    head_size = f"head_width={0.4 * size},head_length={0.8 * size}"
    arrow = {"arrowstyle": f"-|>,{head_size}", "color": colour, "linewidth": 1.6 * size, "shrinkA": 0}
    axes.annotate("", head, tail, arrowprops=arrow, zorder=5)


def _places(axes: Axes, record: RunRecord, size: float) -> None:
    """Mark each follower's place in formation at the end of every timestep."""
    found = [place for follower in record.followers for place in _places_of(record, follower)]
    style = {"markerfacecolor": "none", "markeredgecolor": BLACK, "markersize": 6.5 * size}
    style["markeredgewidth"] = 0.8 * size
    _mark(axes, [(place.x_m, place.y_m) for place in found], marker="D", label="place in formation", **style)


def _places_of(record: RunRecord, follower: FollowerRecord) -> Iterator[Motion]:
    neighbour = beacon_neighbour(follower.name)
    for t, displacement in enumerate(follower.displacements, 1):
        beside = (
            pose_at_end(record, neighbour, t - 1) if record.delayed else pose(record, neighbour, displacement.stamp_ns)
        )
        if beside is not None:
            yield beside.then(record.place(follower.name))


def _mark(axes: Axes, points_m: Sequence[Any] | NDArray[np.float64], **style: Any) -> None:
    if len(points_m):
        axes.plot(*(np.array(points_m) * _CM).T, linestyle="none", zorder=4, **style)


def _components(rows: Sequence[Corrections]) -> NDArray[np.float64]:
    return np.array([(row.u_m, row.v_m) for row in rows]).reshape(-1, 2) * _CM


def _stack(axes: Axes, numbers: Sequence[int], uv_cm: NDArray[np.float64], alpha: float) -> None:
    labelled = alpha == 1.0
    draw = partial(axes.bar, numbers, edgecolor="white", linewidth=0.5, width=0.72, alpha=alpha)
    draw(uv_cm[:, 1], color=V_COLOUR, label="v (forward)" if labelled else None)
    label = "u (lateral)" if labelled else None
    draw(uv_cm[:, 0], bottom=uv_cm[:, 1], color=U_COLOUR, hatch="///", label=label)
