"""Tests that draw tags or look for them are left out where OpenCV has none."""

import pytest

from robot_formation.vision.aruco_patterns import TagError, dictionary


def missing() -> str:
    """What the command line says where OpenCV has no tags; empty where it has."""
    try:
        dictionary()
    except TagError as error:
        return str(error)
    return ""


needs_tags = pytest.mark.skipif(bool(missing()), reason=missing())
