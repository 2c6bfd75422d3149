"""The marker that every robot carries: what tells its faces apart, and how every sensor of it numbers them."""

from __future__ import annotations

from enum import IntEnum

from robot_formation.parameters import Choice


class Face(IntEnum):
    """Faces of the marker; the number is that of the face's colour signature, and of its tag."""

    TARGET = 1
    FRONT = 2
    REAR = 3


class MarkerKind(Choice):
    """What the marker's faces carry and cameras look for: a colour each, or an ArUco tag each."""

    COLOURS = "colours"
    TAGS = "tags"
