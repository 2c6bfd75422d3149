"""The look of all figures: one palette that the colour-blind can tell apart, and matplotlib's settings."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from robot_formation.names import LEADER

P = ParamSpec("P")
R = TypeVar("R")

FORMATS = ("png", "svg", "pdf")
"""Kinds of picture files, by the end of their names."""

# The palette of Okabe and Ito (Color Universal Design, 2008).
BLUE, ORANGE, GREEN, PINK = "#0072B2", "#E69F00", "#009E73", "#CC79A7"
SKY, VERMILION, BLACK = "#56B4E9", "#D55E00", "#000000"
PALETTE = (BLUE, ORANGE, GREEN, PINK, SKY, VERMILION, BLACK)

LEADER_COLOUR = ORANGE  # and the follower blue, as in the paper's figures
FOLLOWER_COLOURS = (BLUE, GREEN, PINK, SKY)
U_COLOUR, V_COLOUR = PINK, GREEN
LOST_COLOUR = "#D00000"
FACE_COLOURS = {"right": VERMILION, "front": GREEN, "rear": BLUE}
"""The marker's faces are red (Target, on the right), green (Front) and blue (Rear): the palette's nearest."""
AUXILIARY = "0.55"
BAND = "0.92"

STYLE: Any = {
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "axes.labelsize": 10.0,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "legend.fontsize": 9.0,
    "legend.frameon": False,
    "figure.titlesize": 12.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.6,
    "text.parse_math": False,  # no formulas: a "$" in a name is a dollar
    "pdf.fonttype": 42,
}


def robot_colour(robot: str) -> str:
    """Return a robot's colour: the leader's, or that of follower n."""
    if robot == LEADER:
        return LEADER_COLOUR
    return FOLLOWER_COLOURS[(int(robot.rpartition("_")[2]) - 1) % len(FOLLOWER_COLOURS)]


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Make a function that draws use the style; matplotlib is imported when it is called."""

    @wraps(draw)
    def draw_styled(*args: P.args, **kwargs: P.kwargs) -> R:
        from matplotlib import rc_context

        with rc_context(STYLE):
            return draw(*args, **kwargs)

    return draw_styled
