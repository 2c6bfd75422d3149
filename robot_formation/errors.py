"""The project's error base, and how its texts show values from outside: short, on one line, without control signs."""

from __future__ import annotations

import reprlib
from typing import Any

MOST_CHARACTERS = 500
"""Length of a message; what is longer loses its middle."""

_SHOWN = 80
_CUT = " ... "
_TAIL = 200  # of a message that is too long: the remedy stands at its end


class FormationError(ValueError):
    """Something from outside is wrong; the text says what and what to do. The command line ends with exit code 2.

    The text is one line of at most 500 characters, whatever a file's name, a key or a value in it contains.
    """

    def __str__(self) -> str:
        """Return the text, cut to one line that a terminal shows as it is."""
        return _one_line(super().__str__())


class MessageError(FormationError):
    """A message can't be used; the text says why."""


def shown(value: Any, most: int = _SHOWN) -> str:
    """Write a value from outside for a message: its `repr`, cut to some 80 characters, however large the value is."""
    text = _REPR.repr(value)
    return text if len(text) <= most else text[: most - 3] + "..."


class _ShortRepr(reprlib.Repr):
    """Looks at no more of a value than it shows."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 3
        self.maxstring = self.maxother = _SHOWN

    def repr_int(self, value: int, level: int) -> str:
        """Write whole numbers; Python itself refuses those of thousands of digits."""
        return repr(value) if value.bit_length() < 256 else f"a whole number of {value.bit_length()} bits"


_REPR = _ShortRepr()


def _one_line(text: str) -> str:
    if len(text) > MOST_CHARACTERS:
        text = text[: MOST_CHARACTERS - _TAIL - len(_CUT)] + _CUT + text[-_TAIL:]
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else " " if sign.isspace() else ascii(sign)[1:-1] for sign in text)
