"""Tutorials that are Python files in jupytext's percent format, as Markdown."""

from __future__ import annotations

import re

_CELL = re.compile(r"^# %%(.*)\n", re.MULTILINE)


def markdown_of(source: str) -> str:
    """Return a Python file of cells as Markdown: comments of Markdown cells as text, the others as code blocks.

    What stands before the first cell (jupytext's header) is left out.
    """
    _, *parts = _CELL.split(source)
    cells = zip(parts[::2], parts[1::2], strict=True)
    blocks = [_text(body) if "[markdown]" in head or "[md]" in head else _code(body) for head, body in cells]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _text(body: str) -> str:
    quoted = re.fullmatch(r'\s*r?"""(.*?)"""\s*', body, re.DOTALL)
    return quoted[1].strip() if quoted else re.sub(r"^# ?", "", body, flags=re.MULTILINE).strip()


def _code(body: str) -> str:
    return f"```python\n{body.strip()}\n```" if body.strip() else ""
