"""Pictures of runs laid over each other: corrections and errors by timestep, and trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantities import FollowerAnalysis, Timestep
from robot_formation.analysis.report import made_folder
from robot_formation.analysis.run_record import Ground
from robot_formation.analysis.style import AUXILIARY, BAND, LOST_COLOUR, PALETTE, styled
from robot_formation.bag.folder import bag_name
from robot_formation.names import LEADER
from robot_formation.reporting.runs import Run, follower_names
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKS = "os^Dv<>"  # runs differ by them too
_LINES = ("-", "--", ":")
_CM, _DEG = 100.0, math.degrees(1.0)
_WIDTH = 5.6  # inches; can still be read when a page shrinks it to a phone's width
_FLAT_M = 1e-6
_MANY = 60  # timesteps from which on single marks would run into each other


def write_comparison(runs: Sequence[Run], folder: Path, picture_format: str = "png") -> list[Path]:
    """Draw all pictures into a folder, made if it is missing; pictures of an older comparison are replaced.

    Args:
        runs: what is compared.
        folder: where to.
        picture_format: png, svg or pdf.

    Raises:
        AnalysisError: the folder or a picture can't be written.
    """
    out = made_folder(folder)
    return [
        draw_corrections_by_timestep(runs, out / f"corrections.{picture_format}"),
        draw_errors_by_timestep(runs, out / f"errors.{picture_format}"),
        draw_trajectories(runs, out / f"trajectories.{picture_format}"),
    ]


def comparison_folder(first: Path) -> Path:
    """Return where pictures go by default: a folder beside the first bag, which need not exist."""
    return first.resolve().with_name(f"{bag_name(first)}_comparison")


@styled
def draw_corrections_by_timestep(runs: Sequence[Run], path: Path) -> Path:
    """Draw each timestep's correction distance, u and v together: a line per run, a panel per follower.

    Raises:
        AnalysisError: the file can't be written.
    """
    names = follower_names(runs)
    figure = new_figure(_WIDTH, 1.0 + 2.3 * len(names))
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        _lines(axes, runs, name, _correction_cm)
        axes.set_ylabel("correction (cm)")
        axes.set_title(name.replace("_", " "), loc="left", fontsize=10)
        axes.axvspan(0.5, COLLECTION_TIMESTEPS + 0.5, color=BAND, zorder=0)
    panels[-1].set_xlabel("timestep (grey: collection phase)")
    _legend(figure, runs)
    return save_figure(figure, path)


@styled
def draw_errors_by_timestep(runs: Sequence[Run], path: Path) -> Path:
    """Draw each timestep's formation error and heading error: a line per run, two panels per follower.

    Raises:
        AnalysisError: the file can't be written.
    """
    names = follower_names(runs)
    figure = new_figure(_WIDTH, 1.0 + 3.8 * len(names))
    panels = figure.subplots(2 * len(names), 1, sharex=True, squeeze=False)[:, 0]
    for upper, lower, name in zip(panels[::2], panels[1::2], names, strict=True):
        _lines(upper, runs, name, _formation_error_cm)
        upper.set_ylim(bottom=0.0)
        upper.set_ylabel("formation error (cm)")
        upper.set_title(name.replace("_", " "), loc="left", fontsize=10)
        _lines(lower, runs, name, _heading_error_deg)
        lower.axhline(0.0, color=AUXILIARY, linewidth=0.8, zorder=1)
        lower.set_ylabel("heading error (deg)")
    panels[-1].set_xlabel("timestep")
    _legend(figure, runs)
    return save_figure(figure, path)


@styled
def draw_trajectories(runs: Sequence[Run], path: Path) -> Path:
    """Draw the true paths of all robots from above over contour lines: the leader thin, a panel per ground.

    Raises:
        AnalysisError: the file can't be written.
    """
    grounds = _by_ground(runs)
    figure = new_figure(_WIDTH, 0.9 + 5.2 * len(grounds))
    panels = figure.subplots(len(grounds), 1, squeeze=False)[:, 0]
    for axes, (ground, shown) in zip(panels, grounds, strict=True):
        if ground is not None:
            _contours(axes, ground)
        for run in shown:
            _paths(axes, run)
        _crop(axes, shown)
        axes.set(xlabel="x (cm); thin line: leader, circle: start, square: end", ylabel="y (cm)", aspect="equal")
        if len(grounds) > 1:
            axes.set_title(", ".join(run.label for run in shown), loc="left", fontsize=10)
    _legend(figure, runs)
    return save_figure(figure, path)


def _lines(axes: Axes, runs: Sequence[Run], name: str, of: Callable[[Timestep], float | None]) -> None:
    from matplotlib.ticker import MaxNLocator

    longest = 0
    for run in runs:
        follower = run.follower(name)
        if follower is None:
            continue
        values = [of(timestep) for timestep in follower.timesteps]
        longest = max(longest, _planned(run, follower))
        many = len(values) > _MANY
        numbers = [timestep.t for timestep in follower.timesteps]
        known = [math.nan if value is None else value for value in values]
        axes.plot(numbers, known, **_style(run), markersize=0 if many else 4)
        if follower.lost and numbers:
            axes.plot(numbers[-1:], known[-1:], "x", color=LOST_COLOUR, markersize=10, markeredgewidth=2.5, zorder=5)
    axes.set_xlim(0.5, max(longest, COLLECTION_TIMESTEPS + 1) + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 2.5, 5, 10], integer=True))
    axes.grid()


def _planned(run: Run, follower: FollowerAnalysis) -> int:
    return max(run.record.timesteps_planned or 0, len(follower.timesteps))


def _style(run: Run) -> dict[str, Any]:
    number = run.number - 1
    return {
        "color": PALETTE[number % len(PALETTE)],
        "linestyle": _LINES[number // len(PALETTE) % len(_LINES)],
        "marker": _MARKS[number % len(_MARKS)],
        "linewidth": 1.5,
    }


def _correction_cm(timestep: Timestep) -> float:
    return (timestep.corrections.u_m + timestep.corrections.v_m) * _CM


def _formation_error_cm(timestep: Timestep) -> float | None:
    return None if timestep.formation_error_m is None else timestep.formation_error_m * _CM


def _heading_error_deg(timestep: Timestep) -> float | None:
    return None if timestep.heading_error_rad is None else timestep.heading_error_rad * _DEG


def _by_ground(runs: Sequence[Run]) -> list[tuple[Ground | None, list[Run]]]:
    """Group the runs by the ground that they drove on."""
    found: list[tuple[Ground | None, list[Run]]] = []
    for run in runs:
        for ground, shown in found:
            if _same(ground, run.record.ground):
                shown.append(run)
                break
        else:
            found.append((run.record.ground, [run]))
    return found


def _same(one: Ground | None, other: Ground | None) -> bool:
    if one is None or other is None:
        return one is other
    return np.array_equal(one.vertices_m, other.vertices_m) and np.array_equal(one.triangles, other.triangles)


def _contours(axes: Axes, ground: Ground) -> None:
    from matplotlib.tri import Triangulation

    x, y, z = ground.vertices_m.T
    axes.update_datalim(ground.vertices_m[:, :2] * _CM)
    if np.ptp(z) >= _FLAT_M:
        mesh = Triangulation(x * _CM, y * _CM, ground.triangles)
        lines = axes.tricontour(mesh, z * 1e3, levels=9, colors="0.7", linewidths=0.7)
        axes.clabel(lines, fmt="%g mm", fontsize=7)


def _paths(axes: Axes, run: Run) -> None:
    style = {**_style(run), "marker": ""}
    for robot, track in run.record.tracks.items():
        xy = track.positions_m[:, :2] * _CM
        axes.plot(*xy.T, **{**style, "linewidth": 0.7 if robot == LEADER else 1.4}, zorder=3)
        _mark(axes, xy[0], "o")
        _mark(axes, xy[-1], "s")


def _mark(axes: Axes, place_cm: NDArray[np.float64], mark: str) -> None:
    style: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": "black", "markersize": 6, "zorder": 4}
    axes.plot(*place_cm, mark, linestyle="none", **style)


def _crop(axes: Axes, runs: Sequence[Run]) -> None:
    """Show where robots were, with a margin, not the whole plate."""
    tracks = [track.positions_m[:, :2] for run in runs for track in run.record.tracks.values()]
    if tracks:
        (left, lower), (right, upper) = (end(np.concatenate(tracks), axis=0) * _CM for end in (np.min, np.max))
        margin = 0.08 * max(right - left, upper - lower) + 5.0
        axes.set(xlim=(left - margin, right + margin), ylim=(lower - margin, upper + margin))


def _legend(figure: Any, runs: Sequence[Run]) -> None:
    """List the runs, where there are several."""
    from matplotlib.lines import Line2D

    if len(runs) > 1:
        named = [(run, f"{run.number}: {_short(run.name)}") for run in runs]
        handles = [Line2D([], [], markersize=4, label=label, **_style(run)) for run, label in named]
        legend_below(figure, handles, 1, fontsize=9)


def _short(name: str) -> str:
    short = name if len(name) <= 60 else f"{name[:28]} ... {name[-27:]}"
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in short)
