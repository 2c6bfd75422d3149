"""Tables of benches that run many scenarios: they grow row by row, and the same command goes on where it stopped."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from robot_formation.batch.resumable_table import ResumableTable
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
