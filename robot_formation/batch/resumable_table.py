"""A CSV file of dataclass rows that grows as work is done, so that work which was stopped goes on where it was.

Beside it lies a JSON record of what the rows depend on, by which its owner tells whether the work is the same.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar, get_args, get_type_hints

from robot_formation.errors import FormationError
from robot_formation.json_values import JsonObject
from robot_formation.system.files import MOST_RECORD_BYTES, read_file, whole_lines

Row = TypeVar("Row")


@dataclass(frozen=True)
class ResumableTable(Generic[Row]):
    """A growing table; its columns are the fields of a dataclass, of type str, int, float, and these or None.

    Attributes:
        path: of the CSV file.
        row: the dataclass.
        error: makes what is raised.
        foreign: what the file isn't if it has other columns, and what to do then.
        damaged: what to do about a line that can't be read.
        added: columns that tables written before lack, and the text that stands for them there.
    """

    path: Path
    row: Callable[..., Row]
    error: Callable[[str], FormationError]
    foreign: str
    damaged: str = "delete it to run it again"
    added: Mapping[str, str] = field(default_factory=dict)

    def read(self) -> Iterator[Row]:
        """Read the rows; a half-written last one is left out.

        Raises:
            FormationError: if the file is no such table.
        """
        kinds = self._kinds()
        try:
            whole = list(whole_lines(self.path))
        except (OSError, ValueError) as error:
            raise self.error(f"{self.path}: can't read it: {error}") from None
        former = {name: kind for name, kind in kinds.items() if name not in self.added}
        header = whole[0].rstrip() if whole else ""
        added = self.added if header == ",".join(former) else {}
        if header != ",".join(former if added else kinds):
            raise self.error(f"{self.path}: {self.foreign}")
        reader = csv.reader(whole)
        next(reader)
        try:
            for cells in reader:
                texts = {**added, **dict(zip(former if added else kinds, cells, strict=True))}
                yield self.row(**{name: _value(kind, texts[name]) for name, kind in kinds.items()})
        except (ValueError, csv.Error):
            raise self.error(f"{self.path}: line {reader.line_num} can't be read; {self.damaged}") from None

    def rewrite(self, rows: Iterable[Row]) -> None:
        """Write the table anew, without a half-written line; it is put in place at once, so that no row is lost."""
        with _replaced(self.path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self._kinds())
            writer.writerows(map(self._cells, rows))
        _replaced(self.path).replace(self.path)

    def append(self, rows: Iterable[Row]) -> None:
        """Append rows; they are in the file when this returns."""
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(map(self._cells, rows))

    def _kinds(self) -> dict[str, object]:
        """Types by column."""
        return get_type_hints(self.row)

    def _cells(self, row: Row) -> list[object]:
        values = (getattr(row, name) for name in self._kinds())
        return ["" if value is None else value for value in values]


def read_record(path: Path) -> JsonObject:
    """Read what a table's rows depend on.

    Raises:
        ValueError: if the file is no such record.
    """
    try:
        found = json.loads(read_file(path, MOST_RECORD_BYTES))
    except (OSError, RecursionError) as error:
        raise ValueError(str(error)) from None
    if not isinstance(found, dict):
        raise ValueError(f"{path} holds no JSON object")
    return found


def write_record(path: Path, record: Mapping[str, object]) -> None:
    """Write what a table's rows depend on; the file is put in place at once."""
    _replaced(path).write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    _replaced(path).replace(path)


def _replaced(path: Path) -> Path:
    """Return the file that becomes another one when it is whole."""
    return path.with_suffix(".partial")


def _value(kind: object, text: str) -> object:
    """Read a cell of type str, int, float, or these or None.

    Raises:
        ValueError: if it holds none.
    """
    choices = get_args(kind) or (kind,)
    if not text and type(None) in choices:
        return None
    value = choices[0](text)
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(text)
    return value
