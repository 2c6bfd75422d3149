"""The paper's two diagrams as this project does it: the follower's timestep, and the visual algorithm."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.analysis.plotting import new_figure, save_figure
from robot_formation.analysis.style import BLUE, GREEN, ORANGE, PINK, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TINTS = {"plain": "0.95", "move": ORANGE, "look": GREEN, "predict": BLUE, "decide": PINK}
_CM = 100.0


@styled
def draw_scheme(path: str | Path) -> Path:
    """Draw a follower's timestep: forecast, move, look and correct until aligned, learn.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure, axes = _canvas(9.6, 4.6, (-1.0, 95.0), (0.0, 52.0))
    boxes = {
        "leader": (10, 30, "leader moves;\nits tick t arrives", "move"),
        "predict": (34, 30, "go as forecast:\nK x(t-1), or the previous\ndisplacement", "move"),
        "look": (58, 30, "look: blocks\nof the Pixy2", "look"),
        "aligned": (82, 30, "inside the\ntolerances?", "decide"),
        "correct": (70, 46, "one correcting\nmove", "move"),
        "sum": (82, 10, "sum of all moves:\ndisplacement\nx(t) = (u, v)", "plain"),
        "learn": (46, 10, "update K with the pair\n(x(t-1), x(t)); forecast\nx(t+1); tick to the leader", "predict"),
    }
    for name, (x, y, text, kind) in boxes.items():
        _box(axes, x, y, 24 if name == "learn" else 20, 10, text, kind)
    for start, end in (("leader", "predict"), ("predict", "look"), ("look", "aligned")):
        _arrow(axes, (boxes[start][0] + 10, 30), (boxes[end][0] - 10, 30))
    _arrow(axes, (82, 35.5), (77, 40.5), "no", (81.5, 37.5))
    _arrow(axes, (63, 40.5), (58, 35.5))
    _arrow(axes, (82, 24.5), (82, 15.5), "yes", (83, 19.5))
    _arrow(axes, (71.5, 10), (58.5, 10))
    _arrow(axes, (33.5, 10), (10, 24.5))
    axes.text(-1, 1.0, "collection phase, t = 1 to 3: the leader's 5 cm, then the previous displacement", fontsize=8)
    return save_figure(figure, path)


@styled
def draw_visual_flow(parameters: AlignmentParameters, path: str | Path) -> Path:
    """Draw the visual algorithm by rules: what is seen, and the move that follows, with the fine-tuner's values.

    The paper's flow chart is not in its source; these are the rules of alignment mode 'paper'.

    Raises:
        AnalysisError: the file can't be written.
    """
    figure, axes = _canvas(10.4, 6.0, (0.0, 104.0), (0.0, 62.0))
    p = parameters
    coarse, fine = f"{p.coarse_step_m * _CM:g} cm", f"{p.fine_step_m * _CM:g} cm"
    _box(axes, 14, 31, 22, 10, "look: which blocks\ndoes the Pixy2 report?", "look")
    entering = (
        ("none", f"stay, look again; after {p.max_empty_looks} times: lost"),
        ("Front only", f"v back by {coarse}; u away if too near"),
        ("Rear only", f"v forward by {coarse}; u away if too near"),
        ("Front and Target", f"v back by {fine}"),
        ("Rear and Target", f"v forward by {fine}"),
        ("Front and Rear, or all", f"u away by {coarse}"),
    )
    fine_tuning = (
        (f"column off by more than {p.v_tolerance_px:g} px", "v by the pan curve"),
        (f"u off by more than {p.u_tolerance_m * _CM:g} cm", "u by the side-length curve"),
        (f"sides differ by more than {p.side_tolerance_px:g} px", f"turn by {math.degrees(p.turn_step_rad):g} degrees"),
        ("none of these", "aligned: end of the timestep"),
    )
    axes.text(69, 60.5, "entering the Target area", ha="center", fontweight="bold")
    for number, (seen, move) in enumerate(entering):
        _rule(axes, 54.2 - 5.2 * number, seen, move, "plain")
    axes.text(69, 23.2, "Target block alone: fine-tuning, the first that holds", ha="center", fontweight="bold")
    for number, (seen, move) in enumerate(fine_tuning):
        _rule(axes, 18.9 - 5.2 * number, seen, move, "predict")
    _arrow(axes, (25, 34), (33, 42))
    _arrow(axes, (25, 28), (33, 14))
    axes.annotate("start, and after each move", (14, 36.5), (14, 50), arrowprops={"arrowstyle": "->"}, ha="center")
    axes.text(50, 57.6, "blocks seen", ha="center", fontsize=9, color="0.3")
    axes.text(86.5, 57.6, "move", ha="center", fontsize=9, color="0.3")
    return save_figure(figure, path)


def _canvas(width: float, height: float, x: tuple[float, float], y: tuple[float, float]) -> tuple[Any, Any]:
    figure = new_figure(width, height)
    axes = figure.subplots()
    axes.set(xlim=x, ylim=y)
    axes.set_axis_off()
    return figure, axes


def _rule(axes: Axes, y: float, seen: str, move: str, kind: str) -> None:
    _box(axes, 50, y, 32, 4.2, seen, kind)
    _arrow(axes, (66, y), (70, y))
    _box(axes, 86.5, y, 33, 4.2, move, "move")


def _box(axes: Axes, x: float, y: float, width: float, height: float, text: str, kind: str) -> None:
    """Draw a box about (x, y) with a text."""
    from matplotlib.patches import FancyBboxPatch

    alpha = 1.0 if kind == "plain" else 0.22
    corner = (x - width / 2, y - height / 2)
    patch = FancyBboxPatch(
        corner, width, height, "round,pad=0,rounding_size=0.8", facecolor=_TINTS[kind], alpha=alpha, edgecolor="none"
    )
    axes.add_patch(patch)
    axes.text(x, y, text, ha="center", va="center", fontsize=9)


def _arrow(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    text: str = "",
    at: tuple[float, float] = (0.0, 0.0),
) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "0.2"})
    if text:
        axes.text(*at, text, fontsize=9, color="0.3")
