"""Docstrings of the code as reStructuredText: they are plain text with code in backticks and indented examples."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

# Substitutions and names that are references in reStructuredText: |x|, coef_.
_SPECIAL = re.compile(r"(?<!\\)\||(?<=\w)_(?!\w)")
_OUTSIDE_CODE = re.compile(r"(`[^`]*`)")


def plain_text(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Let bars and underscores at ends of names mean themselves, and indented paragraphs be examples.

    The arguments are those of Sphinx's event autodoc-process-docstring; `lines` is changed.
    """
    found: list[str] = []
    around: int | None = None  # indentation of the text around the example that a line is in
    for i, line in enumerate(lines):
        if around is not None and line.strip() and _indent(line) <= around:
            around = None
        found.append(line if around is not None else _escaped(line))
        if around is None and _example_follows(lines, i):
            around = _indent(line)
            if line.endswith(":") and not line.endswith("::"):
                found[-1] += ":"
            elif not line.endswith("::"):
                found += ["", " " * around + "::"]
    lines[:] = found


def _escaped(line: str) -> str:
    parts = _OUTSIDE_CODE.split(line)
    parts[::2] = [_SPECIAL.sub(r"\\\g<0>", part) for part in parts[::2]]
    return "".join(parts)


def _example_follows(lines: list[str], i: int) -> bool:
    """Whether a line of text is followed by an empty line and then one with more indentation."""
    if not lines[i].strip() or lines[i].lstrip().startswith((".. ", "- ", "* ")) or i + 2 >= len(lines):
        return False
    return not lines[i + 1].strip() and _indent(lines[i + 2]) > _indent(lines[i])


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())
