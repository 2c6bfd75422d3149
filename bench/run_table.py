"""Benches that run many scenarios: their tables, which grow row by row, and their command line.

The same command goes on where it stopped.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from robot_formation.batch.resumable_table import ResumableTable
from robot_formation.cli.option_types import positive_whole
from robot_formation.errors import FormationError

R = TypeVar("R")
T = TypeVar("T")


def open_table(folder: Path, row: type[R]) -> ResumableTable[R]:
    """Return the table of a folder."""
    return ResumableTable(folder / "runs.csv", row, FormationError, "no table of this bench; choose another OUT")


def missing(folder: Path, row: Any, chosen: Iterable[T]) -> tuple[ResumableTable[Any], list[T]]:
    """Begin or go on with a table; return it with the chosen tasks that it lacks. Rows have a property `task`."""
    folder.mkdir(parents=True, exist_ok=True)
    table = open_table(folder, row)
    done = {found.task for found in table.read()} if table.path.exists() else set()
    if not done:
        table.rewrite(())
    return table, [task for task in chosen if task not in done]


def study_command(
    doc: str | None,
    functions: Mapping[str, Callable[[argparse.Namespace], int]],
    seeds: str,
    choices: Mapping[str, Iterable[str]],
    add_options: Callable[[argparse.ArgumentParser], None] = lambda run: None,
) -> int:
    """Run a bench's command line, whose verbs `run`, `report`, ... take the table's folder; return the exit code.

    Args:
        doc: the bench's documentation.
        functions: by verb; `run` has the options, `figure` takes the file to draw.
        seeds: of `run`, unless --seeds says otherwise.
        choices: names that `run` takes, by option; all of them by default.
        add_options: adds others to `run`.
    """
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    for name, function in functions.items():
        verb = verbs.add_parser(name, help=function.__doc__)
        verb.add_argument("out", type=Path, help="folder of the table")
        verb.set_defaults(function=function)
        if name == "run":
            verb.add_argument("--seeds", default=seeds)
            verb.add_argument("--jobs", type=positive_whole, default=os.cpu_count() or 1)
            for option, every in choices.items():
                verb.add_argument(f"--{option}", type=listed, default=list(every))
            add_options(verb)
        if name == "figure":
            verb.add_argument("file", type=Path)
    args = parser.parse_args()
    try:
        return int(args.function(args))
    except FormationError as error:
        print(error, file=sys.stderr)
        return 2


def listed(text: str) -> list[str]:
    """Read names that commas separate; each counts once."""
    return list(dict.fromkeys(text.split(",")))


def add_settings(run: argparse.ArgumentParser) -> None:
    """Add the option that takes parameters for all runs."""
    run.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
