"""What callers pass: paths and whole numbers, refused in a line where they are none."""

from __future__ import annotations

import os
from operator import index
from pathlib import Path
from typing import Any

import numpy as np

from robot_formation.errors import FormationError, shown


def path_of(name: str, value: Any) -> Path:
    """Return an argument as a path.

    Raises:
        FormationError: it is none; `name` says which argument.
    """
    if not isinstance(value, (str, os.PathLike)):
        raise FormationError(f"{name} is a path, not {shown(value)}")
    try:
        return Path(value)
    except TypeError:  # a path of bytes
        raise FormationError(f"{name} is a path of text, not {shown(value)}") from None


def whole_number(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Return an argument as a whole number, also one of NumPy's; a truth value is none.

    Raises:
        FormationError: it is none, or out of range; `name` says which argument.
    """
    limits = f"from {least} on" if most is None else f"from {least} to {most}"
    try:
        number = None if isinstance(value, (bool, np.bool_)) else index(value)
    except TypeError:
        number = None
    if number is None or number < least or (most is not None and number > most):
        raise FormationError(f"{name} is a whole number {limits}, not {shown(value)}")
    return number
