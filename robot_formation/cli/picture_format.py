"""The option of all verbs that draw: which kind of picture files they write."""

from __future__ import annotations

import argparse

from robot_formation.analysis.style import FORMATS


def add_format(parser: argparse.ArgumentParser, *, default: str | None = FORMATS[0]) -> None:
    """Add the option --format."""
    told = f"kind of the pictures: {', '.join(FORMATS)} (default: {FORMATS[0]})"
    parser.add_argument("--format", metavar="KIND", choices=FORMATS, default=default, help=told)
