"""Errors of reading and writing bags."""

from robot_formation.errors import FormationError


class BagError(FormationError):
    """A bag can't be written or read; the text says which, why, and what to do."""
