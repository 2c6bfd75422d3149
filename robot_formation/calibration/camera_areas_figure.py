"""Picture of the areas around the neighbour: all relative angles overlaid, and each by itself."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_formation.analysis.plotting import new_figure, save_figure
from robot_formation.analysis.style import FACE_COLOURS, styled
from robot_formation.calibration.camera_samples import CameraSample, Kind, Overlay, kinds_of, overlay
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
# Each area in the colour of the face that is seen there.
_COLOURS = {Kind.FRONT: FACE_COLOURS["front"], Kind.TARGET: FACE_COLOURS["right"], Kind.REAR: FACE_COLOURS["rear"]}
_UNATTAINABLE, _NOTHING = "0.60", "0.95"
_COLUMNS = 3


@styled
def draw_areas(
    samples: Sequence[CameraSample], body_m: tuple[float, float], edge_m: float, title: str, path: str | Path
) -> Path:
    """Draw the four areas over the neighbour's frame, u to the right and v up, with the neighbour at the origin.

    Args:
        samples: of the grid; positions that were looked at under fewer angles than others are left out.
        body_m: length and width of a robot.
        edge_m: edge of the marker.
        title: over everything.
        path: of the picture.

    Raises:
        AnalysisError: the file can't be written.
    """
    places = overlay(samples)
    most = max(place.angles for place in places)
    places = [place for place in places if place.angles == most]
    kept = {(place.u_m, place.v_m) for place in places}
    angles = sorted({s.clockwise_deg for s in samples if (s.u_m, s.v_m) in kept})
    rows = -(-len(angles) // _COLUMNS)
    figure = new_figure(12.2, 6.8)
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1.0))
    _overlaid(left.subplots(), places, body_m, edge_m)
    panels = right.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    for panel in panels.flat[len(angles) :]:
        panel.set_visible(False)
    for panel, angle in zip(panels.flat, angles, strict=False):
        own = [s for s in samples if s.clockwise_deg == angle and (s.u_m, s.v_m) in kept]
        _single(panel, own, angle, body_m, edge_m)
    for panel in panels[-1]:
        panel.set_xlabel("u (cm)", fontsize=8)
    for panel in panels[:, 0]:
        panel.set_ylabel("v (cm)", fontsize=8)
    right.suptitle("each relative angle by itself (arrow: the camera's view)", fontsize=10)
    left.suptitle("all relative angles overlaid", fontsize=10)
    figure.suptitle(title, fontsize=12)
    return save_figure(figure, path)


def _overlaid(axes: Axes, places: Iterable[Overlay], body_m: tuple[float, float], edge_m: float) -> None:
    from matplotlib.patches import Patch

    places = list(places)
    size = _cell(places)
    for place in places:
        partly = 0 < place.attainable < place.angles
        _fill(axes, place.u_m, place.v_m, size, place.kinds, attainable=place.attainable > 0)
        if partly:
            _tile(axes, place.u_m, place.v_m, size, facecolor="none", edgecolor=_UNATTAINABLE, hatch="////")
    for place in places:
        if place.seen:
            corner = (place.u_m * _CM - 0.42 * size, place.v_m * _CM - 0.4 * size)
            axes.annotate(str(place.seen), corner, fontsize=8, color="white")
    _neighbour(axes, body_m, edge_m)
    axes.plot(FORMATION_DISTANCE_M * _CM, 0.0, "+", color="black", markersize=11, markeredgewidth=1.6)
    _frame(axes, places)
    axes.set(xlabel="u, to the right of the neighbour (cm)", ylabel="v, ahead of it (cm)")
    legend = [
        Patch(facecolor=_COLOURS[Kind.FRONT], label="Front: the Front block in every view"),
        Patch(facecolor=_COLOURS[Kind.TARGET], label="Target: the Target block alone"),
        Patch(facecolor=_COLOURS[Kind.REAR], label="Rear: the Rear block in every view"),
        Patch(facecolor=_UNATTAINABLE, label="Unattainable at every angle"),
        Patch(facecolor="white", edgecolor=_UNATTAINABLE, hatch="////", label="... at some angles"),
        Patch(facecolor=_NOTHING, label="marker never in view"),
    ]
    note = "two colours: the angle decides; figures: angles with a block; +: place in formation"
    axes.legend(
        handles=legend,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.09),
        ncols=2,
        fontsize=8,
        title=note,
        title_fontsize=8,
    )


def _single(
    panel: Axes, samples: Sequence[CameraSample], angle: float, body_m: tuple[float, float], edge_m: float
) -> None:
    size = _cell(samples)
    for sample in samples:
        _fill(panel, sample.u_m, sample.v_m, size, kinds_of(sample), attainable=sample.attainable)
    _neighbour(panel, body_m, edge_m)
    _frame(panel, samples)
    # The camera looks to the follower's left: against u, turned by the angle.
    turn = np.radians(angle)
    edge = max(s.u_m for s in samples) * _CM
    panel.annotate(
        "",
        (-0.62 * edge - 0.3 * edge * np.cos(turn), 0.72 * edge + 0.3 * edge * np.sin(turn)),
        (-0.62 * edge, 0.72 * edge),
        arrowprops={"arrowstyle": "->", "color": "black", "linewidth": 1.2},
    )
    panel.set_title(f"{angle:+g}°" if angle else "0°", fontsize=9, pad=3)
    panel.tick_params(labelsize=7)


def _fill(axes: Axes, u_m: float, v_m: float, size: float, kinds: Collection[Kind], *, attainable: bool) -> None:
    found = [kind for kind in Kind if kind in kinds]
    if not attainable:
        _tile(axes, u_m, v_m, size, facecolor=_UNATTAINABLE)
        return
    if not found:
        _tile(axes, u_m, v_m, size, facecolor=_NOTHING)
    for number, kind in enumerate(found):
        # Kinds share the tile in strips, the first above, as ahead lies above.
        height = size / len(found)
        middle = v_m * _CM + size / 2.0 - (number + 0.5) * height
        axes.add_patch(_rectangle(u_m * _CM, middle, size, height, facecolor=_COLOURS[kind], edgecolor="none"))
    _tile(axes, u_m, v_m, size, facecolor="none", edgecolor="white")


def _tile(axes: Axes, u_m: float, v_m: float, size: float, **style: object) -> None:
    style = {"edgecolor": "white", "linewidth": 0.6, **style}
    axes.add_patch(_rectangle(u_m * _CM, v_m * _CM, size, size, **style))


def _rectangle(x: float, y: float, width: float, height: float, **style: Any) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - width / 2.0, y - height / 2.0), width, height, **style)


def _neighbour(axes: Axes, body_m: tuple[float, float], edge_m: float) -> None:
    length, width = body_m
    body = _rectangle(0.0, 0.0, width * _CM, length * _CM, facecolor="0.25", edgecolor="black", zorder=3)
    axes.add_patch(body)
    h = edge_m * _CM / 2.0
    axes.add_patch(_rectangle(0.0, 0.0, 2 * h, 2 * h, facecolor="white", edgecolor="none", zorder=4))
    for name, ends in (("right", ([h, h], [-h, h])), ("front", ([-h, h], [h, h])), ("rear", ([-h, h], [-h, -h]))):
        axes.plot(*ends, color=FACE_COLOURS[name], linewidth=2.5, solid_capstyle="butt", zorder=5)


def _frame(axes: Axes, items: Sequence[Overlay] | Sequence[CameraSample]) -> None:
    edge = max(item.u_m for item in items) * _CM + _cell(items) / 2.0
    axes.set(xlim=(-edge, edge), ylim=(-edge, edge), aspect="equal")
    axes.spines[["top", "right"]].set_visible(True)
    ticks = [tick for tick in (-40, -20, 0, 20, 40) if abs(tick) < edge]
    axes.set_xticks(ticks)
    axes.set_yticks(ticks)


def _cell(items: Sequence[Overlay] | Sequence[CameraSample]) -> float:
    """Distance of neighbouring positions, cm."""
    axis = sorted({item.u_m for item in items})
    return float(np.diff(axis).min()) * _CM if len(axis) > 1 else 5.0
