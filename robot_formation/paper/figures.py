"""The paper's figures of runs and of the ground, drawn from our own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_formation.analysis.figures import correction_bars, planned_timesteps, timestep_axis, trajectory_panel
from robot_formation.analysis.plotting import legend_below, new_figure, save_figure
from robot_formation.analysis.quantities import FollowerAnalysis
from robot_formation.analysis.style import (
    FACE_COLOURS,
    FOLLOWER_COLOURS,
    LEADER_COLOUR,
    ORANGE,
    styled,
)
from robot_formation.paper.work import OWN_STARTS, PREDICTORS, TRACKS, Drawn
from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS
from robot_formation.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM, _MM = 100.0, 1e3
_NAMES = {"previous": "without prediction", "measured": "the paper's prediction", "formation": "predictor 'formation'"}


@styled
def draw_trajectories(drawn: Drawn, path: str | Path) -> Path:
    """Draw the runs from above: a row per track, from the same start, then without prediction from its own start.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(13.2, 8.4)
    figure.get_layout_engine().set(h_pad=0.1)
    panels = figure.subplots(len(TRACKS), len(PREDICTORS) + 1, sharex=True, sharey=True)
    letters = iter("abcdefgh")
    for row, (track, own) in zip(panels, zip(TRACKS, OWN_STARTS, strict=True), strict=True):
        chosen = [(track, name) for name in PREDICTORS] + [(own, "previous")]
        for axes, (start, predictor) in zip(row, chosen, strict=True):
            trajectory_panel(axes, *drawn[start, predictor], whole_plate=True)
            axes.set(xlabel="", ylabel="")
            where = ", own start" if start == own else ""
            axes.set_title(f"({next(letters)}) track {track}{where}\n{_NAMES[predictor]}")
    for axes in panels[-1]:
        axes.set_xlabel("x (cm)")
    for axes in panels[:, 0]:
        axes.set_ylabel("y (cm)")
    handles = {h.get_label(): h for axes in panels.flat for h in axes.get_legend_handles_labels()[0]}
    legend_below(figure, list(handles.values()), 7)
    return save_figure(figure, path)


@styled
def draw_correction_pairs(drawn: Drawn, path: str | Path) -> Path:
    """Draw the correction distances per timestep of all methods from the same start: a column per track, one scale.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(12.0, 7.0)
    panels = figure.subplots(len(PREDICTORS), len(TRACKS), sharex="col", sharey=True)
    highest = 0.1
    for column, track in enumerate(TRACKS):
        for row, predictor in enumerate(PREDICTORS):
            axes, (record, analysis) = panels[row, column], drawn[track, predictor]
            timestep_axis(axes, planned_timesteps(record, analysis))
            follower = analysis.followers[0]
            correction_bars(axes, follower)
            highest = max(highest, axes.dataLim.y1)
            axes.set_title(f"track {track}, {_NAMES[predictor]}: {_total(follower)}", loc="left")
        panels[-1, column].set_xlabel("timestep")
    panels[0, 0].set_ylim(0.0, 1.12 * highest)
    for axes in panels[:, 0]:
        axes.set_ylabel("correction distance (cm)")
    handles = {h.get_label(): h for axes in panels.flat for h in axes.get_legend_handles_labels()[0]}
    legend_below(figure, list(handles.values()), 4)
    return save_figure(figure, path)


@styled
def draw_manifold(surface: Surface, size_m: float, path: str | Path) -> Path:
    """Draw the ground as a surface, and its section through the middle and through two corners.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(10.0, 4.2)
    solid = figure.add_subplot(1, 2, 1, projection="3d")
    section = figure.add_subplot(1, 2, 2)
    ticks = np.linspace(0.0, size_m, 60)
    x, y = np.meshgrid(ticks, ticks)
    solid.plot_surface(x * _CM, y * _CM, surface.heights(x, y) * _MM, cmap="cividis", linewidth=0, antialiased=True)
    solid.set(xlabel="x (cm)", ylabel="y (cm)", zlim=(0.0, 220.0))
    solid.set(xticks=(0, 50, 100, 150), yticks=(0, 50, 100, 150), zticks=(0, 100, 200))
    solid.set_zlabel("height (mm)")
    solid.set_box_aspect((1.0, 1.0, 0.35), zoom=0.85)
    middle = np.full_like(ticks, 0.5 * size_m)
    half = 0.5 * size_m
    section.plot(
        (ticks - half) * _MM,
        surface.heights(ticks, middle) * _MM,
        color=FOLLOWER_COLOURS[0],
        label="through the middle, along x",
    )
    corners = np.sqrt(2.0) * (ticks - half) * _MM
    section.plot(corners, surface.heights(ticks, ticks) * _MM, "--", color=ORANGE, label="from corner to corner")
    lowest, highest = surface.height(half, half) * _MM, surface.height(size_m, size_m) * _MM
    for height, place, aside in ((lowest, 0.0, (0, -14)), (highest, corners[-1], (-38, -3))):
        section.annotate(f"{height:.1f} mm", (place, height), aside, textcoords="offset points", ha="center")
    section.set(xlabel="distance from the middle (mm)", ylabel="height (mm)", ylim=(0.0, None))
    section.margins(x=0.08)
    section.legend(loc="lower right")
    section.grid()
    return save_figure(figure, path)


@styled
def draw_illustration(drawn: Drawn, body_m: tuple[float, float], distance_m: float, path: str | Path) -> Path:
    """Draw how far both robots went in each timestep, and the formation from above with the sensing range.

    Both from track two without prediction: in the same time the robots go different ways on curved ground.

    Args:
        drawn: the runs.
        body_m: length and width of a robot.
        distance_m: between the robots in formation.
        path: file to write.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure = new_figure(10.0, 4.2)
    ways, above = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    record, analysis = drawn["two", "measured"]
    follower = record.followers[0]
    count = len(follower.displacements)
    for number, (moves, colour, name) in enumerate(
        (
            (record.leader_moved[:count], LEADER_COLOUR, "leader"),
            (follower.displacements, FOLLOWER_COLOURS[0], "follower"),
        )
    ):
        lengths = [float(np.hypot(*entry.motion.uv_m)) * _CM for entry in moves]
        ways.plot(range(1, count + 1), lengths, "os"[number] + "-", color=colour, markersize=4, label=name)
    timestep_axis(ways, planned_timesteps(record, analysis))
    ways.set(xlabel="timestep", ylabel="way of a timestep (cm)")
    ways.legend()
    ways.grid(axis="y")
    _formation(above, body_m, distance_m)
    return save_figure(figure, path)


def _formation(axes: Axes, body_m: tuple[float, float], distance_m: float) -> None:
    """Draw both robots before and after a timestep, driving up the page."""
    from matplotlib.patches import Rectangle, Wedge

    length, width = (side * _CM for side in body_m)
    distance = distance_m * _CM
    axes.add_patch(Wedge((distance, 0.0), 60.0, 150.0, 210.0, color=ORANGE, alpha=0.18, label="sensing range"))
    bodies: Sequence[tuple[float, float, str, dict[str, Any]]] = (
        (0.0, 0.0, "leader", {"facecolor": LEADER_COLOUR, "alpha": 0.35}),
        (0.0, 5.0, "", {"fill": False, "linestyle": "--", "edgecolor": LEADER_COLOUR}),
        (distance, 0.0, "follower", {"facecolor": FOLLOWER_COLOURS[0], "alpha": 0.35}),
        (distance, 5.0, "ideal place at t + 1", {"fill": False, "hatch": "//", "edgecolor": FOLLOWER_COLOURS[0]}),
        (distance + 1.2, 3.8, "predicted place at t + 1", {"fill": False, "edgecolor": FOLLOWER_COLOURS[0]}),
    )
    for x, y, label, style in bodies:
        axes.add_patch(Rectangle((x - width / 2, y - length / 2), width, length, label=label or None, **style))
    axes.plot([3.0, 3.0], [-3.0, 3.0], color=FACE_COLOURS["right"], linewidth=4, label="Target face")
    arrow = {"arrowstyle": "<->", "color": "0.2", "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (0.0, -24.0), (distance, -24.0), arrowprops=arrow)
    axes.text(distance / 2, -25.0, f"{distance:g} cm", ha="center", va="top")
    for name, aside, ahead in (("v", 0.0, 34.0), ("u", 28.0, 0.0)):
        axes.annotate("", (distance + aside, ahead), (distance, 0.0), arrowprops={"arrowstyle": "->"})
        axes.text(distance + 1.08 * aside, 1.08 * ahead, name, ha="center", va="center")
    axes.set(xlim=(-28.0, 64.0), ylim=(-32.0, 40.0), aspect="equal")
    axes.set_axis_off()
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=3, fontsize=8)


def _total(follower: FollowerAnalysis) -> str:
    total = follower.totals["correction_m"]
    said = "too short" if total is None else f"{total * _CM:.1f} cm"
    return said + (", lost" if follower.lost else f" from timestep {COLLECTION_TIMESTEPS + 1} on")
