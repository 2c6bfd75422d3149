"""A log of displacements, one row per timestep, and its form as a CSV file. Bags give one too: see `from_bag`.

The file's first line names the columns: `u_m` and `v_m`, and where they are known `residual_u_m`, `residual_v_m`,
`commanded_u_m` and `commanded_v_m`, metres, u to the right and v forward. Each of these pairs may have its turn beside
it: `turn_rad`, `residual_turn_rad`, `commanded_turn_rad`, anticlockwise. Other columns are ignored, and so are empty
lines and lines that begin with '#'. All cells of a residual or a command may be empty: it is unknown in that timestep.
An empty `residual_turn_rad` beside a known residual says that the heading is unknown.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.errors import AnalysisError
from robot_formation.errors import shown
from robot_formation.koopman.predictors.spatial import after
from robot_formation.parameters import suggestion
from robot_formation.system.files import read_file

DISPLACEMENT, RESIDUAL, COMMANDED = (
    (f"{prefix}u_m", f"{prefix}v_m", f"{prefix}turn_rad") for prefix in ("", "residual_", "commanded_")
)
_MOTIONS = (DISPLACEMENT, RESIDUAL, COMMANDED)
_COLUMNS = tuple(name for motion in _MOTIONS for name in motion)
# What `float` takes beyond this (underscores, other alphabets' digits) is a slip in a log.
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
_SHOWN = 40  # characters of a wrong cell
_MOST_BYTES = 32 << 20
_MOST_ROWS = 100_000  # a forecast of each takes up to a millisecond
_MOST_CHARACTERS = 20_000  # of a line


@dataclass(frozen=True)
class DisplacementLog:
    """Displacements of one robot, (u, v, turn) in metres and radians.

    Where a file or an older run tells no turns they are 0, but for the residuals': those are NaN, unknown.

    Attributes:
        source: the file or bag, for messages.
        places: (n,) where each row stands in the source: "line 2", "timestep 1".
        displacements: (n, 3) net displacement of each timestep.
        residuals: (n, 3) what the camera saw left at the end, desired minus actual; NaN where unknown, in its last
            column where only the heading is.
        commanded: (n, 3) what the displacement would have been had the prediction move gone as commanded; NaN where
            unknown.
    """

    source: str
    places: tuple[str, ...]
    displacements: NDArray[np.float64]
    residuals: NDArray[np.float64]
    commanded: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.places)

    @property
    def has_residuals(self) -> bool:
        """Whether a residual is known in any timestep."""
        return bool(np.isfinite(self.residuals).any())

    @property
    def has_turns(self) -> bool:
        """Whether a turn is told in any timestep."""
        found = np.stack([self.displacements, self.residuals, self.commanded])[..., 2]
        return bool(np.nan_to_num(found).any())

    @property
    def has_commanded(self) -> bool:
        """Whether a command is known in any timestep."""
        return bool(np.isfinite(self.commanded).any())

    @property
    def targets(self) -> NDArray[np.float64]:
        """What forecasts are compared with, (n, 3).

        The ideal move (displacement, then residual), NaN where the residual is unknown; the displacement itself if the
        log has no residuals.
        """
        if not self.has_residuals:
            return self.displacements
        return np.array([after(x, r) for x, r in zip(self.displacements, self.residuals, strict=True)])


def read_log(path: str | Path) -> DisplacementLog:
    """Read a log from a CSV file: UTF-8, separated by commas, with a header.

    Raises:
        AnalysisError: the file can't be read, a column is missing or twice there, or a row is bad; the text names the
            line.
    """
    lines = _lines(Path(path))
    header = next(lines, None)
    if header is None:
        raise AnalysisError(f"{path} is empty; its first line has to name the columns, like u_m,v_m")
    columns = _columns(f"{path}, line {header[0]}", header[1])
    width = len(header[1])
    places: list[str] = []
    rows: list[list[float]] = []
    for number, cells in lines:
        where = f"{path}, line {number}"
        if len(cells) != width:
            raise AnalysisError(f"{where}: the header names {width} columns, the row has {len(cells)}; correct the row")
        if len(rows) == _MOST_ROWS:
            raise AnalysisError(f"{where}: a log holds up to {_MOST_ROWS} timesteps; split the file")
        rows.append([value for motion in _MOTIONS for value in _motion(where, motion, columns, cells)])
        places.append(f"line {number}")
    if not rows:
        raise AnalysisError(f"{path} has a header but no rows; add one row per timestep")
    values = np.array(rows)
    return DisplacementLog(str(path), tuple(places), values[:, 0:3], values[:, 3:6], values[:, 6:9])


def write_log(log: DisplacementLog, path: str | Path) -> None:
    """Write a log as a CSV file that `read_log` reads back to the last bit; what it knows nothing of gets no column.

    Raises:
        AnalysisError: the file exists already, or can't be written.
    """
    arrays: list[tuple[tuple[str, ...], NDArray[np.float64]]] = [(DISPLACEMENT, log.displacements)]
    arrays += [(RESIDUAL, log.residuals)] if log.has_residuals else []
    arrays += [(COMMANDED, log.commanded)] if log.has_commanded else []
    if not log.has_turns:
        arrays = [(names[:2], values[:, :2]) for names, values in arrays]
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
    for name in _COLUMNS:
        if header.count(name) > 1:
            raise AnalysisError(f"{where}: column '{name}' is there {header.count(name)} times; leave one")
    for motion in _MOTIONS:
        missing = [name for name in motion[:2] if name not in header]
        if missing and (motion is DISPLACEMENT or len(missing) == 1 or motion[2] in header):
            hint = suggestion(missing[0], [cell[:_SHOWN] for cell in header if cell not in _COLUMNS])
            raise AnalysisError(f"{where}: no column '{missing[0]}' in the header{hint}")
    return {name: header.index(name) for name in _COLUMNS if name in header}


def _motion(where: str, names: tuple[str, ...], columns: dict[str, int], cells: Sequence[str]) -> tuple[float, ...]:
    """Read u, v and turn; all NaN where they are unknown and may be."""
    if names[0] not in columns:
        return math.nan, math.nan, math.nan
    texts = [cells[columns[name]] if name in columns else "" for name in names]
    if names != DISPLACEMENT and not any(texts):
        return math.nan, math.nan, math.nan
    u_m, v_m = (_number(where, name, text) for name, text in zip(names[:2], texts[:2], strict=True))
    if names[2] not in columns or (names is RESIDUAL and not texts[2]):
        return u_m, v_m, math.nan if names is RESIDUAL else 0.0
    return u_m, v_m, _number(where, names[2], texts[2])


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
    raise AnalysisError(
        f"{where}: {name} is {text[:_SHOWN]!r}, which is no number; write metres, or radians of a turn, like 0.05"
    )
