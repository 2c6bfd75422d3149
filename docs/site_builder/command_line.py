"""The page of the command line: the README's table of verbs, and the help of each."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from sphinx.ext.autodoc.mock import mock  # type: ignore[attr-defined]
from sphinx.util.logging import getLogger

from site_builder.links import Links
from site_builder.pages import readme_section

_LOG = getLogger(__name__)
PAGE = "reference/command_line.md"


def command_line_page(root: Path, links: Links, mocked: Sequence[str]) -> dict[str, str]:
    """Make the page; `mocked` modules need not be installed."""
    text = readme_section(root, links, "commands", PAGE)
    text = re.sub(r"^# .*", "# Command line", text)
    with mock(list(mocked)), _width("100"):
        try:
            from robot_formation.cli.main import make_parser
        except Exception as error:  # of a mocked package; rosdoc2 goes on without the help
            _LOG.warning("no help of the command line, which can't be imported: %s", error)
            return {PAGE: text}
        parts = [f"## {name}\n\n```text\n{text}```\n" for name, text in _helps(make_parser())]
    return {PAGE: "\n".join([text, *parts])}


def _helps(parser: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """Yield name and help of each verb, and of each of the verbs of a verb."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                yield verb.prog, verb.format_help()
                yield from _helps(verb)


@contextmanager
def _width(columns: str) -> Iterator[None]:
    """Let argparse wrap at the same width and without colours, wherever the site is built."""
    before = {name: os.environ.get(name) for name in ("COLUMNS", "NO_COLOR")}
    os.environ.update(COLUMNS=columns, NO_COLOR="1")
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
