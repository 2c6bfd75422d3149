"""The marker that every robot carries: what tells its faces apart."""

from __future__ import annotations

from robot_formation.parameters import Choice


class MarkerKind(Choice):
    """What the marker's faces carry and cameras look for: a colour each, or an ArUco tag each."""

    COLOURS = "colours"
    TAGS = "tags"
