"""The faces of the marker that a camera can see, as every sensor of it numbers them."""

from __future__ import annotations

from enum import IntEnum


class Face(IntEnum):
    """Faces of the marker; the number is that of the face's colour signature, and of its tag."""

    TARGET = 1
    FRONT = 2
    REAR = 3
