"""Lines for the person at the terminal; standard output is for results."""

from __future__ import annotations

import sys


def say(text: str) -> None:
    """Print a line to standard error."""
    print(text, file=sys.stderr, flush=True)


def warn(text: str) -> None:
    """Print a warning to standard error."""
    say(f"warning: {text}")
