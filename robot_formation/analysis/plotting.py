"""Figures without a display: made with Agg, and matplotlib is imported when one is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_formation.analysis.errors import AnalysisError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 150
FORMATS = (".png", ".svg", ".pdf")
_GAP = 0.01  # between a legend and the figure's lower edge, share of the figure's height
# Looks the same where the font is missing; without a salt of its own the names in it are random.
_SVG: Any = {"svg.fonttype": "path", "svg.hashsalt": "robot_formation"}
_TIMELESS = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def new_figure(width: float, height: float) -> Any:
    """Make an empty figure of a size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # No pyplot: it would choose a backend and keep every figure alive.
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def legend_below(figure: Figure, handles: Sequence[object], columns: int, **style: object) -> None:
    """Write a legend, centred, below all panels, in rows of about equal length; the layout keeps its room free.

    Not by the place "outside lower center", which matplotlib has from 3.7 on only.

    Args:
        figure: made by `new_figure`.
        handles: what the legend lists, each with its label.
        columns: most entries in a row.
        style: further arguments of matplotlib's legend.
    """
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    rows = -(-len(handles) // columns)
    legend = figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, _GAP),
        borderaxespad=0.0,
        ncols=-(-len(handles) // max(rows, 1)),
        frameon=False,
        **style,
    )
    room = _GAP + legend.get_window_extent().height / figure.bbox.height
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(rect=(0.0, room, 1.0, 1.0 - room))


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure in the format that the path's ending says; an older file there is replaced.

    Texts of an SVG become outlines, unless the caller has set matplotlib's svg.hashsalt and chosen.

    Raises:
        AnalysisError: the file can't be written, or isn't a .png, .svg or .pdf file.
    """
    from matplotlib import rc_context, rcParams

    if Path(path).suffix.lower() not in FORMATS:
        raise AnalysisError(f"{path}: pictures are .png, .svg or .pdf files")
    try:
        with rc_context({} if rcParams["svg.hashsalt"] else _SVG):
            # Without the time of day.
            figure.savefig(path, dpi=DPI, metadata=_TIMELESS.get(Path(path).suffix.lower()))
    except OSError as error:
        raise AnalysisError(f"{path} can't be written: {error.strerror or error}; choose another folder") from error
    return Path(path)
