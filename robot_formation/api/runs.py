"""Runs: carried out in this process, or read from a bag."""

from __future__ import annotations

import copy
import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot_formation import exit_codes
from robot_formation.analysis import report as reports
from robot_formation.analysis.conditions import run_facts
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import FollowerAnalysis, RunAnalysis, analyse
from robot_formation.analysis.run_record import RunRecord, Track
from robot_formation.api.inputs import path_of
from robot_formation.errors import FormationError, shown
from robot_formation.extras import require
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import JsonObject
from robot_formation.names import LEADER

if TYPE_CHECKING:
    import pandas as pd

    from robot_formation.api.scenarios import Scenario
    from robot_formation.experiment.scenario import Scenario as Definition

Array = NDArray[np.float64]
KINDS = ("png", "svg", "pdf")


@dataclass(frozen=True, repr=False)
class Leader:
    """The leader of a run: n moves by its encoder wheels, m true poses by the simulation.

    Attributes:
        name: "leader".
        moved: (n, 2) displacement of each timestep, (u, v), metres.
        moved_turn: (n,) turn of each timestep, radians; NaN where unknown.
        times: (m,) simulated times of the poses, seconds.
        positions: (m, 3) x, y, z in the world, metres.
        headings: (m,) anticlockwise from the world's x, radians.
    """

    name: str
    moved: Array
    moved_turn: Array
    times: Array
    positions: Array
    headings: Array

    def __repr__(self) -> str:
        """Return the essentials in a line."""
        return f"<{type(self).__name__} {self.name!r}, {len(self.moved)} timesteps>"


@dataclass(frozen=True, repr=False)
class Follower(Leader):
    """A follower of a run: n finished timesteps, m true poses. What is unknown is NaN.

    Attributes:
        timesteps: (n,) their numbers, from 1.
        predicted: (n, 2) forecast of each timestep, which was driven first; (u, v), metres.
        predicted_turn: (n,) its turn, radians.
        corrections: (n, 2) summed |u| and |v| of the moves after the prediction move, metres.
        correction_turn: (n,) summed |turn| of these moves, radians.
        movements: (n,) number of these moves, whole numbers.
        residual: (n, 2) what the camera says is left at the end, metres.
        residual_turn: (n,) its turn, radians.
        formation_error: (n,) true distance from the place in formation, metres.
        formation_error_uv: (n, 2) the same as a vector (u, v) in the neighbour's frame, metres.
        heading_error: (n,) heading minus that of the neighbour, radians.
        blind: (n,) whether the timestep was without the camera.
        lost: whether the follower has lost its neighbour from view.
        totals: of the whole run, as the command line's JSON has them.
    """

    timesteps: NDArray[np.int64]
    predicted: Array
    predicted_turn: Array
    corrections: Array
    correction_turn: Array
    movements: NDArray[np.int64]
    residual: Array
    residual_turn: Array
    formation_error: Array
    formation_error_uv: Array
    heading_error: Array
    blind: NDArray[np.bool_]
    lost: bool
    totals: Mapping[str, Any]


@dataclass(frozen=True, repr=False)
class Run:
    """A run and what its analysis says. `run` and `analyze` make one.

    Attributes:
        record: the run as the package itself handles it; not part of the documented interface.
        analysis: the same run's quantities; not part of the documented interface.
        bag: where it is recorded; None: nowhere.
        in_process: whether it ran in one process; None: unknown.
        reason: why it ended before its end; empty if it didn't, or if that is unknown.
        warnings: what its nodes warned of.
    """

    record: RunRecord
    analysis: RunAnalysis
    bag: Path | None = None
    in_process: bool | None = None
    reason: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def scenario(self) -> str | None:
        """Name of the scenario."""
        return self.analysis.scenario

    @property
    def outcome(self) -> str:
        """How it ended: done, lost, left_plate or incomplete."""
        return self.analysis.outcome

    @property
    def details(self) -> dict[str, Any]:
        """Which run it was: seed, predictor, path, surface, conditions; None where it doesn't say."""
        return run_facts(self.record.details, in_process=self.in_process)

    @property
    def totals(self) -> Mapping[str, Any]:
        """Totals of the first follower, as the command line's JSON has them."""
        return copy.deepcopy(self.analysis.followers[0].totals)

    @cached_property
    def leader(self) -> Leader:
        """The leader."""
        return Leader(**_robot(LEADER, [move.motion for move in self.record.leader_moved], self.record))

    @cached_property
    def followers(self) -> dict[str, Follower]:
        """The followers by name: follower_1, ..."""
        return {found.name: _follower(found, self.record) for found in self.analysis.followers}

    def summary(self) -> str:
        """Return the tables and totals that `formation run` prints: centimetres and degrees."""
        return reports.text_report(self.record, self.analysis)

    def report(self) -> JsonObject:
        """Return what `formation run --json` prints, as a dictionary."""
        return copy.deepcopy(
            reports.run_report(self.record, self.analysis, in_process=self.in_process, bag=self.bag, reason=self.reason)
        )

    def to_pandas(self) -> pd.DataFrame:
        """Return a table with a row per follower and timestep; its columns are named and in units as in the JSON.

        Raises:
            FormationError: pandas is not installed.
        """
        from robot_formation.api.tables import table

        counts = ("moves_by_axis", "moves_by_kind")
        rows = [
            {"follower": follower.name, **{name: value for name, value in row.items() if name not in counts}}
            for follower in self.analysis.followers
            for row in (timestep.to_json() for timestep in follower.timesteps)
        ]
        return table(rows, ("follower", "t"))

    def save_pictures(self, folder: str | os.PathLike[str], kind: str = "png") -> list[Path]:
        """Draw the standard pictures into a folder, as `formation analyze` does; older ones are replaced.

        Args:
            folder: is made if it is missing.
            kind: png, svg or pdf.

        Raises:
            FormationError: a file can't be written, or there is no such kind.
        """
        if kind not in KINDS:
            raise FormationError(f"kind is one of {', '.join(KINDS)}, not {shown(kind)}")
        return reports.write_pictures(self.record, self.analysis, path_of("folder", folder), kind)

    def __repr__(self) -> str:
        """Return the essentials in a line."""
        facts, totals = self.details, self.totals
        said = [repr(self.scenario or "run"), self.outcome]
        said += [f"{name} {facts[name]}" for name in ("predictor", "surface", "seed") if facts[name] is not None]
        said.append(f"{totals['timesteps_finished']} timesteps")
        if totals["correction_m"] is not None:
            said.append(f"correction {100.0 * totals['correction_m']:.1f} cm")
        if totals["formation_error_rmse_m"] is not None:
            said.append(f"formation error {100.0 * totals['formation_error_rmse_m']:.2f} cm RMSE")
        return f"<Run {', '.join(said)}>"


def run(
    scenario: Scenario, *, bag: str | os.PathLike[str] | None = None, images: bool = False, progress: bool = False
) -> Run:
    """Run a scenario in this process, without ROS nodes; the same run as `formation run`, to the last bit.

    Args:
        scenario: what to run.
        bag: folder to record the run into, which must not be there yet; None: nothing is recorded.
        images: whether the bag holds the pictures too (126 MB per thousand).
        progress: whether to print a line per timestep to standard error.

    Raises:
        FormationError: PyBullet or ROS's messages are not installed, the bag's folder is taken, or the run fails.
            A run that loses its leader doesn't raise: its `outcome` says so.
    """
    # Imported here, so that whoever only analyses a bag needs nothing of what a run needs.
    from robot_formation.api.scenarios import definition_of
    from robot_formation.experiment.one_process import check_one_process

    definition = definition_of(scenario)
    folder = None if bag is None else path_of("bag", bag)
    require("sim", "ros")
    check_one_process(definition)
    say: Callable[[str], None] = _print if progress else _ignore
    if folder is not None:
        return _recorded(definition, folder, images, say)
    if images:
        raise FormationError("images=True records pictures into a bag; give bag= too")
    return _in_memory(definition, say)


def analyze(bag: str | os.PathLike[str], *, namespace: str | None = None) -> Run:
    """Analyse the bag of a run; needs neither ROS nor PyBullet.

    Args:
        bag: its folder, an .mcap file, or the .partial folder of a run that was killed.
        namespace: the formation's, where the bag holds several formations.

    Raises:
        FormationError: the bag can't be read, or holds no run of a formation.
    """
    path = path_of("bag", bag)
    record = load_run(path, namespace)
    return Run(record, analyse(record), path)


def _in_memory(definition: Definition, say: Callable[[str], None]) -> Run:
    from robot_formation.experiment.in_memory_record import run_with_details
    from robot_formation.experiment.in_process import progress_of
    from robot_formation.launching.processes import run_metadata

    progress = progress_of(definition, say)
    record, result = run_with_details(definition, run_metadata(definition), beside=progress)
    return Run(record, analyse(record), None, True, result.reason, tuple(result.warnings))


def _recorded(definition: Definition, bag: Path, images: bool, say: Callable[[str], None]) -> Run:
    from robot_formation.experiment.in_process import run_in_process
    from robot_formation.launching.processes import run_metadata

    result = run_in_process(definition, bag, run_metadata(definition), images=images, say=say)
    if result.exit_code == exit_codes.INTERRUPTED:
        raise KeyboardInterrupt
    if result.exit_code == exit_codes.NODE_DIED:
        raise FormationError(result.reason)
    record = load_run(bag)
    return Run(record, analyse(record), bag, True, result.reason, tuple(result.warnings))


def _print(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _ignore(text: str) -> None:
    pass


def _robot(name: str, moves: Iterable[Motion], record: RunRecord) -> dict[str, Any]:
    """Return the arrays that leader and followers have."""
    moved = list(moves)
    track = record.tracks.get(name) or Track(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0))
    return {
        "name": name,
        "moved": _pairs(moved),
        "moved_turn": _numbers(move.yaw_rad for move in moved),
        "times": track.stamps_ns / 1e9,
        "positions": track.positions_m.copy(),  # the record's stay as they are
        "headings": track.yaws_rad.copy(),
    }


def _follower(found: FollowerAnalysis, record: RunRecord) -> Follower:
    steps = found.timesteps
    return Follower(
        **_robot(found.name, [step.moved for step in steps], record),
        timesteps=np.array([step.t for step in steps], np.int64),
        predicted=_pairs([step.predicted for step in steps]),
        predicted_turn=_numbers(step.predicted_turn_rad for step in steps),
        corrections=_rows((step.corrections.u_m, step.corrections.v_m) for step in steps),
        correction_turn=_numbers(step.corrections.turn_rad for step in steps),
        movements=np.array([step.corrections.movements for step in steps], np.int64),
        residual=_pairs([step.residual for step in steps]),
        residual_turn=_numbers(step.residual_turn_rad for step in steps),
        formation_error=_numbers(step.formation_error_m for step in steps),
        formation_error_uv=_rows(step.error_uv_m or (math.nan, math.nan) for step in steps),
        heading_error=_numbers(step.heading_error_rad for step in steps),
        blind=np.array([step.blind for step in steps], np.bool_),
        lost=found.lost,
        totals=copy.deepcopy(found.totals),
    )


def _pairs(moves: Sequence[Motion | None]) -> Array:
    return _rows((math.nan, math.nan) if move is None else move.uv_m for move in moves)


def _rows(values: Iterable[tuple[float, float]]) -> Array:
    return np.array(list(values), float).reshape(-1, 2)


def _numbers(values: Iterable[float | None]) -> Array:
    return np.array([math.nan if value is None else value for value in values], float)
