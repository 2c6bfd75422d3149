"""From a run's bag to its figures, tables and pictures."""

from robot_formation.analysis.spectrum_figure import plot_modes, plot_spectrum

__all__ = ["plot_modes", "plot_spectrum"]
