"""Driving blind: how far the follower strays in blackouts of 1, 2, 3 and 5 timesteps, per path and predictor.

Each run has one of each length, some timesteps with the camera between them; that of three begins with timestep 30.
Paths, surfaces and predictors are among those of `leader_paths.py`; the fine-tuner is in mode precise. OUT/runs.csv
grows row by row, and the same command goes on where it was stopped. `report` prints medians over seeds: the formation
error at the end of each blackout, by how much the formation-error vector grew over that of three timesteps, and how
often the follower was in its place again after it. A lost run counts as infinitely far.

    python bench/blackouts.py run OUT --seeds 0:10 [--paths circle12,slalom8] [--predictors previous+close,formation]
    python bench/blackouts.py report OUT
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import leader_path_runs
from leader_path_runs import PATHS, SURFACES, Task
from leader_path_tables import BASELINE, OWN, cell, print_table
from robot_formation.analysis.markdown import table
from robot_formation.analysis.quantities import FollowerAnalysis, analyse
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.sweep import seeds
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from run_table import add_settings, missing, open_table, study_command

BLACKOUTS = {1: 18, 2: 23, 3: 30, 5: 38}
"""First blind timestep by length."""
TIMESTEPS = 46
SEEN_AGAIN = 3
"""Timesteps with the camera within which the leader has to be in its place again."""
IN_PLACE_M = 0.05
"""Formation error up to which the follower counts as in its place again."""
PREDICTORS = ("previous+close", "trend+close", "edmd+close", "formation")
PATHS_HERE = tuple(name for name in PATHS if name not in ("straight", "stadium", "clothoid", "random_walk", "switch"))


@dataclass(frozen=True)
class Row:
    """What a run yields; errors at the end of each blackout [m], None where the run ended before."""

    path: str
    surface: str
    predictor: str
    seed: int
    outcome: str
    timesteps: int
    error_1_m: float | None
    error_2_m: float | None
    error_3_m: float | None
    error_5_m: float | None
    growth_3_m: float | None
    found_again_3: int | None

    @property
    def task(self) -> Task:
        """The run that it is of."""
        return Task(self.path, self.surface, self.predictor, self.seed)


def build(task: Task, settings: Sequence[str]) -> scenarios.Scenario:
    """Make a run's scenario.

    Raises:
        FormationError: on a misspelt or wrong setting KEY=VALUE.
    """
    blackouts = ", ".join(f"[{first}, {length}]" for length, first in BLACKOUTS.items())
    own = (f"leader.timesteps={TIMESTEPS}", f"blackouts=[{blackouts}]", "fine_tuner.mode=precise")
    return leader_path_runs.build(task, [*own, *settings])


def run_task(task: Task, settings: Sequence[str]) -> Row:
    """Carry out one run."""
    analysis = analyse(run_in_memory(build(task, settings)))
    follower = analysis.followers[0]
    ends = {length: error(follower, first + length - 1) for length, first in BLACKOUTS.items()}
    before, after = error(follower, BLACKOUTS[3] - 1), ends[3]
    again = [error(follower, BLACKOUTS[3] + 3 + k) for k in range(SEEN_AGAIN)]
    reached = [float(np.hypot(*found)) < IN_PLACE_M for found in again if found is not None]
    lengths = {length: None if end is None else float(np.hypot(*end)) for length, end in ends.items()}
    return Row(
        *task,
        outcome=analysis.outcome,
        timesteps=follower.totals["timesteps_finished"],
        error_1_m=lengths[1],
        error_2_m=lengths[2],
        error_3_m=lengths[3],
        error_5_m=lengths[5],
        growth_3_m=None if before is None or after is None else float(np.hypot(*np.subtract(after, before))),
        found_again_3=None if after is None else int(any(reached)),
    )


def error(follower: FollowerAnalysis, timestep: int) -> tuple[float, float] | None:
    """Return the formation error (u, v) [m] at the end of a timestep; None if the run ended before."""
    found = [t.error_uv_m for t in follower.timesteps if t.t == timestep]
    return found[0] if found else None


def carry_out(args: argparse.Namespace) -> int:
    """Run what is missing in the table."""
    chosen = [
        Task(path, args.surface, predictor, seed)
        for seed in seeds(args.seeds)
        for path in args.paths
        for predictor in args.predictors
    ]
    stored, tasks = missing(args.out, Row, chosen)
    for task in {(task.path, task.seed): task for task in tasks}.values():
        build(task, args.set).check()
    rows = run_parallel(run_task, ((task, args.set) for task in tasks), args.jobs)
    for row in with_progress(rows, len(tasks)):
        stored.append([row])
    return 0


def report(args: argparse.Namespace) -> int:
    """Print medians over the seeds, one line per path and predictor."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in open_table(args.out, Row).read():
        groups.setdefault((row.path, row.surface, row.predictor), []).append(row)
    print("Formation error [cm] at the end of blackouts of 1, 2, 3 and 5 timesteps; growth of its vector over three;")
    print("runs in which the follower was in its place again within three timesteps after these")
    lines = []
    for group, rows in groups.items():
        errors = [median_cm([getattr(row, f"error_{length}_m") for row in rows]) for length in BLACKOUTS]
        growth = median_cm([row.growth_3_m for row in rows])
        found = f"{sum(row.found_again_3 or 0 for row in rows)} of {len(rows)}"
        lost = sum(row.outcome != "done" for row in rows)
        lines.append([*group, str(len(rows)), str(lost), *errors, growth, found])
    head = [
        "path",
        "surface",
        "predictor",
        "seeds",
        "lost",
        *(str(length) for length in BLACKOUTS),
        "growth",
        "in place",
    ]
    print_table(head, lines)
    return 0


def page_lines(rows: Sequence[Row]) -> list[str]:
    """Return the page's table by path: median errors of all predictors; growths of `formation` against the baseline."""
    groups: dict[str, dict[str, dict[int, Row]]] = {}
    for row in rows:
        groups.setdefault(row.path, {}).setdefault(row.predictor, {})[row.seed] = row
    names = [*(f"error_{length}_m" for length in BLACKOUTS), "growth_3_m"]
    lines = []
    for path, found in groups.items():
        base, own = found.get(BASELINE, {}), found.get(OWN, {})
        predictors = [name for name in PREDICTORS if name in found]
        medians = [
            " / ".join(median_cm([getattr(row, name) for row in found[used].values()]) for used in predictors)
            for name in names
        ]
        paired = [
            ratio(own[seed].growth_3_m, base[seed].growth_3_m)
            for seed in own.keys() & base.keys()
            if own[seed].growth_3_m is not None or base[seed].growth_3_m is not None
        ]
        again = " / ".join(str(sum(row.found_again_3 or 0 for row in found[used].values())) for used in predictors)
        lines.append([path, str(len(own)), *medians, cell(paired, 1.0, 2), again])
    head = ["path", "runs", *map(str, BLACKOUTS), "growth over 3", "ratio of the growths", "in place again"]
    return table(head, lines)


def ratio(own: float | None, base: float | None) -> float:
    """Return the ratio of two lengths; a missing one, of a run that was lost before, is infinite."""
    if own is None:
        return math.inf
    return own / base if base else 0.0 if base is None else math.inf


def median_cm(values: Sequence[float | None]) -> str:
    """Median in centimetres; a missing value, of a run that was lost before, is infinite."""
    return f"{100.0 * float(np.median([math.inf if value is None else value for value in values])):.1f}"


def add_options(run: argparse.ArgumentParser) -> None:
    """Add what only this bench takes."""
    run.add_argument("--surface", default="bowl", choices=list(SURFACES))
    add_settings(run)


def main() -> int:
    choices = {"paths": PATHS_HERE, "predictors": PREDICTORS}
    return study_command(__doc__, {"run": carry_out, "report": report}, "0:10", choices, add_options)


if __name__ == "__main__":
    sys.exit(main())
