"""Figures without a display: made with Agg, and matplotlib is imported when one is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robot_formation.analysis.errors import AnalysisError

DPI = 150


def new_figure(width: float, height: float) -> Any:
    """Make an empty figure of a size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # No pyplot: it would choose a backend and keep every figure alive.
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: str | Path) -> Path:
    """Write a figure; an older file there is replaced.

    Raises:
        AnalysisError: the file can't be written.
    """
    try:
        figure.savefig(path, dpi=DPI)
    except OSError as error:
        raise AnalysisError(f"{path} can't be written: {error.strerror or error}; choose another folder") from error
    return Path(path)
