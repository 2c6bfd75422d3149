"""A log of displacements, one row per timestep, and its form as a CSV file. Bags give one too: see `from_bag`.

The file's first line names the columns: `u_m` and `v_m`, and where they are known `residual_u_m`, `residual_v_m`,
`commanded_u_m` and `commanded_v_m`, metres, u to the right and v forward. Other columns are ignored, and so are empty
lines and lines that begin with '#'. Both cells of a residual or a command may be empty: it is unknown in that timestep.
A column `turn_rad` holds the displacement's turn, anticlockwise.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.errors import AnalysisError
from robot_formation.errors import shown
from robot_formation.parameters import suggestion
from robot_formation.system.files import read_file

DISPLACEMENT, RESIDUAL, COMMANDED = ((f"{prefix}u_m", f"{prefix}v_m") for prefix in ("", "residual_", "commanded_"))
_PAIRS = (DISPLACEMENT, RESIDUAL, COMMANDED)
TURN = "turn_rad"
COLUMNS = (*(name for pair in _PAIRS for name in pair), TURN)
"""Names of all columns that a log may have."""
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""Units of length that a log may be in, and their lengths in metres."""
# What `float` takes beyond this (underscores, other alphabets' digits) is a slip in a log.
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
_SHOWN = 40  # characters of a wrong cell
_MOST_BYTES = 32 << 20
_MOST_ROWS = 100_000  # a forecast of each takes up to a millisecond
_MOST_CHARACTERS = 20_000  # of a line


@dataclass(frozen=True)
class DisplacementLog:
    """Displacements of one robot, (u, v) in metres.

    Attributes:
        source: the file or bag, for messages.
        places: (n,) where each row stands in the source: "line 2", "timestep 1".
        displacements_m: (n, 2) net displacement of each timestep.
        residuals_m: (n, 2) what the camera saw left at the end, desired minus actual; NaN where unknown.
        commanded_m: (n, 2) what the displacement would have been had the prediction move gone as commanded; NaN where
            unknown.
        turns_rad: (n,) turn of each timestep, anticlockwise; zero where the log has none.
        skipped: what was wrong with the rows that were left out, for messages.
    """

    source: str
    places: tuple[str, ...]
    displacements_m: NDArray[np.float64]
    residuals_m: NDArray[np.float64]
    commanded_m: NDArray[np.float64]
    turns_rad: NDArray[np.float64]
    skipped: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.places)

    @property
    def has_residuals(self) -> bool:
        """Whether a residual is known in any timestep."""
        return bool(np.isfinite(self.residuals_m).any())

    @property
    def has_commanded(self) -> bool:
        """Whether a command is known in any timestep."""
        return bool(np.isfinite(self.commanded_m).any())

    @property
    def targets_m(self) -> NDArray[np.float64]:
        """What forecasts are compared with, (n, 2).

        The ideal move (displacement plus residual), NaN where the residual is unknown; the displacement itself if the
        log has no residuals.
        """
        if not self.has_residuals:
            return self.displacements_m
        # A residual is expressed in the frame in which the displacement ends.
        u, v = self.residuals_m.T
        cosines, sines = np.cos(self.turns_rad), np.sin(self.turns_rad)
        return np.asarray(self.displacements_m + np.column_stack([cosines * u - sines * v, sines * u + cosines * v]))


def read_log(
    path: str | Path, *, columns: Mapping[str, str] | None = None, unit: str = "m", skip_bad: bool = False
) -> DisplacementLog:
    """Read a log from a CSV file: UTF-8, separated by commas, with a header.

    Args:
        path: the file.
        columns: what the file calls some of `COLUMNS`.
        unit: of lengths in the file, one of `UNITS`.
        skip_bad: leave bad rows out instead of refusing the file.

    Raises:
        AnalysisError: the file can't be read, a column is missing or twice there, or a row is bad; the text names the
            line.
    """
    lines = _lines(Path(path))
    header = next(lines, None)
    if header is None:
        raise AnalysisError(f"{path} is empty; its first line has to name the columns, like u_m,v_m")
    found = _columns(f"{path}, line {header[0]}", _renamed(f"{path}, line {header[0]}", header[1], columns or {}))
    width = len(header[1])
    places: list[str] = []
    rows: list[list[float]] = []
    skipped: list[str] = []
    for number, cells in lines:
        if len(rows) == _MOST_ROWS:
            raise AnalysisError(f"{path}, line {number}: a log holds up to {_MOST_ROWS} timesteps; split the file")
        try:
            rows.append(_row(f"{path}, line {number}", cells, width, found))
        except AnalysisError as error:
            if not skip_bad:
                raise
            skipped.append(str(error))
            continue
        places.append(f"line {number}")
    if not rows:
        raise AnalysisError(f"{path} has a header but no {'good ' if skipped else ''}rows; add one row per timestep")
    values = np.array(rows)
    lengths = values[:, :6] * UNITS[unit]
    return DisplacementLog(
        str(path), tuple(places), lengths[:, 0:2], lengths[:, 2:4], lengths[:, 4:6], values[:, 6], tuple(skipped)
    )


def _row(where: str, cells: Sequence[str], width: int, columns: dict[str, int]) -> list[float]:
    """Read (u, v) of displacement, residual and command, and the turn."""
    if len(cells) != width:
        raise AnalysisError(f"{where}: the header names {width} columns, the row has {len(cells)}; correct the row")
    values = [value for pair in _PAIRS for value in _pair(where, pair, columns, cells)]
    return [*values, _number(where, TURN, cells[columns[TURN]]) if TURN in columns else 0.0]


def _renamed(where: str, header: Sequence[str], columns: Mapping[str, str]) -> list[str]:
    """Return the header with our names instead of the file's."""
    ours = {theirs: name for name, theirs in columns.items()}
    for theirs in ours:
        if theirs not in header:
            raise AnalysisError(f"{where}: no column '{theirs[:_SHOWN]}' in the header{suggestion(theirs, header)}")
    return [ours.get(name, f"other {name}" if name in columns else name) for name in header]


def write_log(log: DisplacementLog, path: str | Path) -> None:
    """Write a log as a CSV file that `read_log` reads back to the last bit; what it knows nothing of gets no column.

    Raises:
        AnalysisError: the file exists already, or can't be written.
    """
    arrays: list[tuple[tuple[str, ...], NDArray[np.float64]]] = [(DISPLACEMENT, log.displacements_m)]
    arrays += [(RESIDUAL, log.residuals_m)] if log.has_residuals else []
    arrays += [(COMMANDED, log.commanded_m)] if log.has_commanded else []
    arrays += [((TURN,), log.turns_rad[:, None])] if log.turns_rad.any() else []
    rows = np.hstack([values for _, values in arrays]).tolist()
    try:
        with Path(path).open("x", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([name for names, _ in arrays for name in names])
            writer.writerows([["" if math.isnan(value) else repr(value) for value in row] for row in rows])
    except FileExistsError:
        raise AnalysisError(f"{path} exists already and is not overwritten; choose another file") from None
    except OSError as error:
        raise AnalysisError(f"{path} can't be written: {error.strerror or error}; choose another file") from error


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield each line's number and cells; cells may be quoted but can't go on in the next line."""
    try:
        with io.StringIO(read_file(path, _MOST_BYTES).decode("utf-8-sig"), newline=None) as file:
            for number, line in enumerate(file, 1):
                if len(line) > _MOST_CHARACTERS:
                    raise AnalysisError(
                        f"{path}, line {number}: has more than {_MOST_CHARACTERS} characters; correct it"
                    )
                if line.strip() and not line.lstrip().startswith("#"):
                    cells = next(csv.reader([line.rstrip("\n")], strict=True, skipinitialspace=True))
                    yield number, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise AnalysisError(f"{path}, line {number}: no CSV: {error}; correct the line") from error
    except UnicodeDecodeError as error:
        raise AnalysisError(f"{path} is no text in UTF-8; save it as CSV in UTF-8, or give a bag by --bag") from error
    except OSError as error:
        raise AnalysisError(f"{path} can't be read: {error.strerror or error}; give a CSV file") from error


def _columns(where: str, header: Sequence[str]) -> dict[str, int]:
    """Find the columns by name."""
    others = [mark for mark in (";", "\t") if any(mark in cell for cell in header)]
    if others:
        raise AnalysisError(f"{where}: columns are separated by {shown(others[0])}; separate them by commas")
    for name in COLUMNS:
        if header.count(name) > 1:
            raise AnalysisError(f"{where}: column '{name}' is there {header.count(name)} times; leave one")
    for pair in _PAIRS:
        missing = [name for name in pair if name not in header]
        if missing and (pair is DISPLACEMENT or len(missing) == 1):
            hint = suggestion(missing[0], [cell[:_SHOWN] for cell in header if cell not in COLUMNS])
            raise AnalysisError(f"{where}: no column '{missing[0]}' in the header{hint}")
    return {name: header.index(name) for name in COLUMNS if name in header}


def _pair(where: str, names: tuple[str, str], columns: dict[str, int], cells: Sequence[str]) -> tuple[float, float]:
    """Read u and v; both NaN where they are unknown and may be."""
    if names[0] not in columns:
        return math.nan, math.nan
    texts = [cells[columns[name]] for name in names]
    if names != DISPLACEMENT and not any(texts):
        return math.nan, math.nan
    u_m, v_m = (_number(where, name, text) for name, text in zip(names, texts, strict=True))
    return u_m, v_m


def _number(where: str, name: str, text: str) -> float:
    if not text:
        raise AnalysisError(f"{where}: {name} is empty; fill it in or leave the row out")
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if math.isfinite(value):
        return value
    if _NOT_FINITE.fullmatch(text) or math.isinf(value):
        raise AnalysisError(
            f"{where}: {name} is {text[:_SHOWN]!r}, which is not finite; correct it or leave the row out"
        )
    raise AnalysisError(f"{where}: {name} is {text[:_SHOWN]!r}, which is no number; write metres like 0.05")
