"""Picture of the formation error over simulated time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.figures import rmse_text, run_title
from robot_formation.analysis.in_motion import place_errors_m
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantities import FollowerAnalysis, RunAnalysis
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Track
from robot_formation.analysis.style import BAND, BLACK, robot_colour, styled
from robot_formation.geometry.se2 import Motion
from robot_formation.names import beacon_neighbour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
_S = 1e-9


@styled
def draw_formation_error(record: RunRecord, analysis: RunAnalysis, path: str | Path) -> Path:
    """Draw each follower's formation error while the run goes on, and where its timesteps ended.

    The error grows when the neighbour drives and falls when the follower does; what counts is the error at the end of a
    timestep. With delayed spacing only these are drawn. Timesteps without the camera are grey.

    Args:
        record: the run; without tracks only the frame is drawn.
        analysis: the same run's quantities.
        path: file to write; an older picture there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    rows = len(analysis.followers)
    figure = new_figure(8.0, 1.3 + 2.2 * rows)
    panels = figure.subplots(rows, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, follower, found in zip(panels, record.followers, analysis.followers, strict=True):
        error_panel(axes, record, follower, found)
        if rows > 1:
            axes.set_title(follower.name.replace("_", " "), loc="left")
    panels[0].set_ylim(bottom=0.0)
    panels[0].set_title(rmse_text(analysis), loc="right", fontsize=9)
    panels[-1].set_xlabel("simulated time (s)")
    handles = {handle.get_label(): handle for axes in panels for handle in axes.get_legend_handles_labels()[0]}
    legend_below(figure, list(handles.values()), 4)
    figure.suptitle(run_title(record, analysis))
    return save_figure(figure, path)


def errors_over_time(own: Track, neighbour: Track, place: Motion) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the formation error at every time at which one of the two robots has told its pose.

    Args:
        own: the follower's track.
        neighbour: its beacon neighbour's.
        place: the follower's in the neighbour's frame.

    Returns:
        Simulated times (n,) in ns, and errors (n,) in metres.
    """
    stamps = np.union1d(own.stamps_ns, neighbour.stamps_ns)
    numbers = [np.searchsorted(track.stamps_ns, stamps, side="right") - 1 for track in (own, neighbour)]
    known = (numbers[0] >= 0) & (numbers[1] >= 0)
    follower, beside = (number[known] for number in numbers)
    poses = np.column_stack([neighbour.positions_m[beside, :2], neighbour.yaws_rad[beside]])
    return stamps[known], place_errors_m(own.positions_m[follower, :2], poses, place)


def error_panel(axes: Axes, record: RunRecord, follower: FollowerRecord, found: FollowerAnalysis) -> None:
    """Draw a follower's formation error over simulated time: centimetres over seconds."""
    axes.set_ylabel("formation error (cm)")
    axes.grid(axis="y")
    own, beside = (record.tracks.get(robot) for robot in (follower.name, beacon_neighbour(follower.name)))
    if own is not None and beside is not None and not record.delayed:
        stamps, errors = errors_over_time(own, beside, record.place(follower.name))
        colour = robot_colour(follower.name)
        axes.plot(stamps * _S, errors * _CM, color=colour, linewidth=0.9, alpha=0.8, label="while robots move")
    starts_ns = [0, *(end.stamp_ns for end in follower.displacements)]
    ends = []
    for timestep in found.timesteps:
        start_s, end_s = (starts_ns[timestep.t + shift] * _S for shift in (-1, 0))
        if timestep.blind:
            axes.axvspan(start_s, end_s, color=BAND, zorder=0, linewidth=0, label="without the camera")
        if timestep.formation_error_m is not None:
            ends.append((end_s, timestep.formation_error_m * _CM))
    if ends:
        axes.plot(*np.array(ends).T, "o", color=BLACK, markersize=3.5, label="end of a timestep", zorder=3)
