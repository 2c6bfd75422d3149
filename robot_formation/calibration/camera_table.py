"""The table of a camera's calibration: a CSV file that grows position by position, so that a stopped one goes on."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

from robot_formation.batch.resumable_table import ResumableTable, read_record, write_record
from robot_formation.calibration.camera_grid import Position
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.drive.curves import CalibrationError
from robot_formation.vision.pixy2.block import Block

TABLE_NAME = "vision.csv"
RECORD_NAME = "vision.json"
Key = tuple[float, float]


@dataclass(frozen=True)
class TableRow:
    """One reported block of a sample, or a sample in which nothing was reported; see `CameraSample` and `Block`.

    The block's columns are empty where nothing was reported.
    """

    u_m: float
    v_m: float
    clockwise_deg: float
    attainable: int
    frames: int
    signature: int | None = None
    x: int | None = None
    y: int | None = None
    width: int | None = None
    height: int | None = None
    angle: int | None = None
    index: int | None = None
    age: int | None = None

    def __post_init__(self) -> None:
        """Check that the block is whole, or none."""
        if len({value is None for value in astuple(self)[_POSE_COLUMNS:]}) != 1:
            raise ValueError("half a block")


_POSE_COLUMNS = 5


class VisionTable:
    """The growing table of a folder, and the record of what it is a table of.

    Attributes:
        path: of the CSV file.
        samples: by position, what is in the table; whole positions only.
    """

    def __init__(self, folder: Path, record: Mapping[str, object], positions: Sequence[Position]) -> None:
        """Open a folder's table: a new one, or that of an earlier calibration under the same conditions.

        Raises:
            CalibrationError: if the folder holds a table of other conditions, or one that can't be read.
        """
        self.path = folder / TABLE_NAME
        recorded = folder / RECORD_NAME
        self.samples: dict[Key, list[CameraSample]] = {}
        if recorded.exists():
            _require_same(recorded, record)
        elif self.path.exists():
            raise CalibrationError(f"{self.path} is there without its record {RECORD_NAME}; start anew with --force")
        write_record(recorded, record)
        self._table = _table(self.path)
        if self.path.exists():
            wanted = {(p.u_m, p.v_m): len(p.angles_deg) for p in positions}
            groups: dict[Key, list[CameraSample]] = {}
            for sample in read_table(self.path):
                groups.setdefault((sample.u_m, sample.v_m), []).append(sample)
            # A position that was cut off by the end of the last run is looked at again.
            self.samples = {key: found for key, found in groups.items() if len(found) == wanted.get(key)}
        self._table.rewrite(row for found in self.samples.values() for row in _rows(found))

    def add(self, found: Sequence[CameraSample]) -> None:
        """Append all samples of a position; they are in the file when this returns."""
        self.samples[found[0].u_m, found[0].v_m] = list(found)
        self._table.append(_rows(found))

    def remaining(self, positions: Iterable[Position]) -> list[Position]:
        """List the positions that are not in the table yet."""
        return [position for position in positions if (position.u_m, position.v_m) not in self.samples]

    def all(self, positions: Iterable[Position]) -> list[CameraSample]:
        """List all samples in the positions' order, which doesn't depend on the workers'."""
        return [sample for p in positions for sample in self.samples[p.u_m, p.v_m]]


def read_table(path: Path) -> Iterator[CameraSample]:
    """Read a table; a half-written last line is left out.

    Raises:
        CalibrationError: if the file is no such table.
    """
    for pose, rows in itertools.groupby(_table(path).read(), key=lambda row: astuple(row)[:_POSE_COLUMNS]):
        u_m, v_m, clockwise_deg, attainable, frames = pose
        blocks = tuple(Block(*astuple(row)[_POSE_COLUMNS:]) for row in rows if row.signature is not None)
        yield CameraSample(u_m, v_m, clockwise_deg, bool(attainable), frames, blocks)


def _table(path: Path) -> ResumableTable[TableRow]:
    return ResumableTable(
        path,
        TableRow,
        CalibrationError,
        "no table of a camera's calibration; start anew with --force",
        "start anew with --force, or delete it",
    )


def _rows(samples: Iterable[CameraSample]) -> Iterator[TableRow]:
    for s in samples:
        for block in s.blocks or (None,):
            cells = () if block is None else astuple(block)
            yield TableRow(s.u_m, s.v_m, s.clockwise_deg, int(s.attainable), s.frames, *cells)


def _require_same(recorded: Path, record: Mapping[str, object]) -> None:
    try:
        earlier = read_record(recorded)
    except ValueError:
        raise CalibrationError(f"{recorded}: no record of a calibration; start anew with --force") from None
    different = [name for name in {**earlier, **record} if earlier.get(name) != record.get(name)]
    if different:
        name = different[0]
        raise CalibrationError(
            f"{recorded.parent} holds a calibration with {name} {earlier.get(name)} instead of {record.get(name)}; "
            "choose another folder with --out, or start anew with --force"
        )
