"""Keeps a log short when the same thing goes wrong again and again."""

from __future__ import annotations

import re
from collections import Counter

_ALWAYS = 5
_MOST_KINDS = 200
_MOST_CHARACTERS = 1000
_VARIABLE = re.compile(r"'[^']*'|\"[^\"]*\"|[-+]?[0-9][0-9.e+-]*|\b(?:nan|inf)\b")


class Repetitions:
    """Decides which texts are worth a line: of one kind the first five, then the 10th, 100th, 1000th and so on.

    Texts are of one kind if they differ in numbers and quoted words only.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def line(self, text: str) -> str | None:
        """Return the line to log for a text, None if it has been said often enough."""
        kind = _VARIABLE.sub("", text[:_MOST_CHARACTERS])
        if kind not in self._counts and len(self._counts) >= _MOST_KINDS:
            kind = ""
        self._counts[kind] += 1
        count = self._counts[kind]
        if len(text) > _MOST_CHARACTERS:
            text = text[:_MOST_CHARACTERS] + " ..."
        if count <= _ALWAYS:
            return text
        if str(count).strip("0") == "1":
            return f"{text} ({count} times so far)"
        return None
