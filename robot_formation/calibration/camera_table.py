"""The table of a camera's calibration: a CSV file that grows position by position, so that a stopped one goes on."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from robot_formation.calibration.camera_grid import Position
from robot_formation.calibration.camera_samples import CameraSample
from robot_formation.drive.curves import CalibrationError
from robot_formation.system.files import MOST_RECORD_BYTES, read_file, whole_lines
from robot_formation.vision.pixy2.block import Block

TABLE_NAME = "vision.csv"
RECORD_NAME = "vision.json"
_POSE = ("u_m", "v_m", "clockwise_deg", "attainable", "frames")
_BLOCK = tuple(field.name for field in fields(Block))
COLUMNS = (*_POSE, *_BLOCK)
"""One row per reported block; the block's columns are empty where nothing was reported."""

Key = tuple[float, float]


class VisionTable:
    """The growing table of a folder, and the record of what it is a table of.

    Attributes:
        path: of the CSV file.
        samples: by position, what is in the table; whole positions only.
    """

    def __init__(self, folder: Path, record: Mapping[str, Any], positions: Sequence[Position]) -> None:
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
        recorded.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
        if self.path.exists():
            wanted = {(p.u_m, p.v_m): len(p.angles_deg) for p in positions}
            groups: dict[Key, list[CameraSample]] = {}
            for sample in read_table(self.path):
                groups.setdefault((sample.u_m, sample.v_m), []).append(sample)
            # A position that was cut off by the end of the last run is looked at again.
            self.samples = {key: found for key, found in groups.items() if len(found) == wanted.get(key)}
        unfinished = self.path.with_suffix(".partial")
        with unfinished.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            for found in self.samples.values():
                writer.writerows(_rows(found))
        unfinished.replace(self.path)

    def add(self, found: Sequence[CameraSample]) -> None:
        """Append all samples of a position; they are in the file when this returns."""
        self.samples[found[0].u_m, found[0].v_m] = list(found)
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(_rows(found))

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
    try:
        reader = csv.reader(list(whole_lines(path)))
    except (OSError, ValueError) as error:
        raise CalibrationError(f"{path}: can't read it: {error}") from None
    if tuple(next(reader, ())) != COLUMNS:
        raise CalibrationError(f"{path}: no table of a camera's calibration; start anew with --force")
    pose: tuple[float, float, float, bool, int] | None = None
    blocks: list[Block] = []
    for cells in reader:
        try:
            found = (float(cells[0]), float(cells[1]), float(cells[2]), bool(int(cells[3])), int(cells[4]))
            block = Block(*map(int, cells[5:])) if cells[5] else None
        except (ValueError, IndexError, TypeError):
            raise CalibrationError(
                f"{path}: line {reader.line_num} can't be read; start anew with --force, or delete it"
            ) from None
        if pose is not None and found != pose:
            yield CameraSample(*pose, tuple(blocks))
            blocks = []
        pose = found
        blocks += [block] if block is not None else []
    if pose is not None:
        yield CameraSample(*pose, tuple(blocks))


def _rows(samples: Iterable[CameraSample]) -> Iterator[list[Any]]:
    for s in samples:
        pose = [s.u_m, s.v_m, s.clockwise_deg, int(s.attainable), s.frames]
        for block in s.blocks:
            yield [*pose, *astuple(block)]
        if not s.blocks:
            yield [*pose, *("" for _ in _BLOCK)]


def _require_same(recorded: Path, record: Mapping[str, Any]) -> None:
    try:
        earlier = json.loads(read_file(recorded, MOST_RECORD_BYTES))
        different = [name for name in {**earlier, **record} if earlier.get(name) != record.get(name)]
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        raise CalibrationError(f"{recorded}: no record of a calibration; start anew with --force") from None
    if different:
        name = different[0]
        raise CalibrationError(
            f"{recorded.parent} holds a calibration with {name} {earlier.get(name)} instead of {record.get(name)}; "
            "choose another folder with --out, or start anew with --force"
        )
