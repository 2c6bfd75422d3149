"""Errors of the analysis."""

from robot_formation.errors import FormationError


class AnalysisError(FormationError):
    """A run can't be analysed; the text says why and what to do."""
