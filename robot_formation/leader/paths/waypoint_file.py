"""Reads the CSV files of waypoints, each refused with one line that says which line of it is wrong."""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Sequence
from pathlib import Path

from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import ParameterError
from robot_formation.system.files import read_file

Row = tuple[float, ...]

POSES = ("x_m", "y_m", "yaw_rad")
MOTIONS = ("dx_m", "dy_m", "dyaw_rad")
TIME = "t_s"
POLYNOMIAL_COLUMNS = 33
"""Of a piece: its duration, then eight coefficients each of x, y, z and yaw, constant term first (crazyswarm)."""

_FORMS = "x_m,y_m[,yaw_rad], t_s,x_m,y_m[,yaw_rad], dx_m,dy_m,dyaw_rad or the 33 columns of crazyswarm"
_MOST_BYTES = 64 << 20
_MOST_MOTIONS = 1_000_000
_GAP = 10.0
"""A file whose times are this many medians apart somewhere has a gap."""


def read_motions(path: Path, step_s: float, scale: float = 1.0, *, along: bool = False) -> tuple[Motion, ...]:
    """Read a file as one motion per timestep.

    Args:
        path: of the file.
        step_s: time of the file that a timestep takes, seconds; for forms with times.
        scale: factor on all lengths.
        along: look along the way to the next point, where the file has no headings.

    Raises:
        ParameterError: if the file can't be read, or a column or value in it can't be used.
    """
    lines = _lines(path)
    header, rows = lines[0], lines[1:]
    names = tuple(name.strip() for name in header)
    if len(names) == POLYNOMIAL_COLUMNS:
        try:
            _numbers(path, [header], names)
        except ParameterError:
            pass  # as it should be: names
        else:
            raise ParameterError(f"{path}: its first line holds numbers; a file of polynomials begins with a header")
        return _between(_from_polynomials(path, _numbers(path, rows, names), step_s), scale)
    known = (MOTIONS, POSES[:2], POSES, (TIME, *POSES[:2]), (TIME, *POSES))
    if names not in known:
        shown = ",".join(names)[:60]
        raise ParameterError(f"{path}: its first line '{shown}' names no known columns; a path has {_FORMS}")
    values = _numbers(path, rows, names)
    if names == MOTIONS:
        return tuple(Motion(scale * x, scale * y, yaw) for x, y, yaw in values)
    if len(values) < 2:
        raise ParameterError(f"{path}: holds {len(values)} points; a path needs two or more")
    with_heading = names[-1] == POSES[-1]
    if not with_heading and along:
        values = _looking_along(path, values, names)
        with_heading = True
    if names[0] == TIME:
        return _between(_resampled(path, values, step_s, with_heading=with_heading), scale)
    return _between([Motion(*row) for row in values], scale)


def _lines(path: Path) -> list[list[str]]:
    try:
        text = read_file(path, _MOST_BYTES).decode("utf-8-sig")
        lines = list(csv.reader(io.StringIO(text, newline="")))
    except OSError as error:
        raise ParameterError(f"{path}: can't read this path: {error.strerror or error}") from None
    except (UnicodeDecodeError, csv.Error):
        raise ParameterError(f"{path}: no CSV file of text; a path has columns {_FORMS}") from None
    while lines and not lines[-1]:
        lines.pop()
    if len(lines) < 2:
        raise ParameterError(f"{path}: holds no points below its line of column names; a path has columns {_FORMS}")
    return lines


def _numbers(path: Path, lines: Sequence[Sequence[str]], names: Sequence[str]) -> list[Row]:
    rows = []
    for number, cells in enumerate(lines, start=2):
        if len(cells) != len(names):
            raise ParameterError(
                f"{path}: line {number} has {len(cells)} values for {len(names)} columns; "
                "fill the gap or delete the line"
            )
        rows.append(tuple(_number(path, number, name, cell) for name, cell in zip(names, cells, strict=True)))
    return rows


def _number(path: Path, line: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        said = f"'{cell.strip()[:40]}'" if cell.strip() else "empty"
        raise ParameterError(f"{path}: line {line}: '{name}' is {said}; every value must be a number") from None
    if not math.isfinite(value) or abs(value) > 1e9:
        raise ParameterError(f"{path}: line {line}: '{name}' is {value}; every value must be finite")
    return value


def _looking_along(path: Path, rows: Sequence[Row], names: Sequence[str]) -> list[Row]:
    """Add to every point the direction to the next one, to the last one that of the one before."""
    first = 1 if names[0] == TIME else 0
    directions = []
    for number, (before, after) in enumerate(itertools.pairwise(rows), start=2):
        dx, dy = after[first] - before[first], after[first + 1] - before[first + 1]
        if dx == dy == 0.0:
            raise ParameterError(
                f"{path}: lines {number} and {number + 1} are the same point, so that no heading can follow the way; "
                "delete one, add a column yaw_rad or take heading=kept"
            )
        directions.append(math.atan2(dy, dx))
    return [(*row, angle) for row, angle in zip(rows, [*directions, directions[-1]], strict=True)]


def _between(poses: Sequence[Motion], scale: float) -> tuple[Motion, ...]:
    """Return the motions from pose to pose, turned by less than half a turn each."""
    motions = []
    for before, after in itertools.pairwise(poses):
        step = after.relative_to(before)
        motions.append(Motion(scale * step.x_m, scale * step.y_m, math.remainder(step.yaw_rad, 2.0 * math.pi)))
    return tuple(motions)


def _steps(path: Path, duration_s: float, step_s: float) -> int:
    """Count the whole timesteps in a duration."""
    steps = math.floor(duration_s / step_s + 1e-9)
    if not 1 <= steps <= _MOST_MOTIONS:
        raise ParameterError(
            f"{path}: lasts {duration_s:g} s, which are {steps} timesteps of step_s = {step_s:g} s; choose step_s "
            f"so that there are 1 to {_MOST_MOTIONS}"
        )
    return steps


def _resampled(path: Path, rows: Sequence[Row], step_s: float, *, with_heading: bool) -> list[Motion]:
    """Interpolate between rows of time, x, y and perhaps heading; headings the short way round."""
    spans = [after[0] - before[0] for before, after in itertools.pairwise(rows)]
    usual = sorted(spans)[len(spans) // 2]
    for number, span in enumerate(spans, start=3):
        if span <= 0.0:
            raise ParameterError(f"{path}: line {number}: 't_s' must grow from line to line")
    for number, span in enumerate(spans, start=3):
        if span > _GAP * usual:
            raise ParameterError(
                f"{path}: a gap of {span:g} s before line {number}, where lines are {usual:g} s apart otherwise; "
                "fill it or cut the file there"
            )
    poses, row = [], 0
    for step in range(_steps(path, rows[-1][0] - rows[0][0], step_s) + 1):
        time = min(rows[0][0] + step * step_s, rows[-1][0])
        while row < len(rows) - 2 and rows[row + 1][0] < time:
            row += 1
        before, after = rows[row], rows[row + 1]
        share = (time - before[0]) / (after[0] - before[0])
        x_m, y_m = (a + share * (b - a) for a, b in zip(before[1:3], after[1:3], strict=True))
        turn = math.remainder(after[3] - before[3], 2.0 * math.pi) if with_heading else 0.0
        poses.append(Motion(x_m, y_m, before[3] + share * turn if with_heading else 0.0))
    return poses


def _from_polynomials(path: Path, pieces: Sequence[Row], step_s: float) -> list[Motion]:
    """Sample pieces of polynomials of degree 7 at every timestep's end."""
    for number, piece in enumerate(pieces, start=2):
        if piece[0] <= 0.0:
            raise ParameterError(f"{path}: line {number}: a piece's duration must be above 0, not {piece[0]:g} s")
    total_s = sum(piece[0] for piece in pieces)
    poses, index, begun_s = [], 0, 0.0
    for step in range(_steps(path, total_s, step_s) + 1):
        time = min(step * step_s, total_s)
        while index < len(pieces) - 1 and time - begun_s > pieces[index][0]:
            begun_s += pieces[index][0]
            index += 1
        piece, local = pieces[index], time - begun_s
        x_m, y_m, _, yaw = (_polynomial(piece[1 + 8 * axis : 9 + 8 * axis], local) for axis in range(4))
        poses.append(Motion(x_m, y_m, yaw))
    return poses


def _polynomial(coefficients: Sequence[float], at: float) -> float:
    value = 0.0
    for coefficient in reversed(coefficients):
        value = value * at + coefficient
    return value
