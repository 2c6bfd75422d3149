"""Formations of N followers by schedule and spacing: errors along the chain, and time per timestep.

Each run is one number of followers, schedule, spacing, leader's path and seed, in process, camera on demand. The
ground is a shallow bowl of 6 m (0.02 1/m). OUT/runs.csv grows row by row, one row per follower, and the same command
goes on where it was stopped. `report` prints per case: medians over seeds of the formation error of the first, the
middle and the last follower, the geometric mean of the ratio from one follower to the next with a 95 % bootstrap
interval, simulated and processor time per timestep, and lost runs.

    python bench/chain.py run OUT --followers 1,2,3,5,10 --seeds 0:5 [--schedules turns,timer+delayed]
    python bench/chain.py report OUT
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from robot_formation.analysis.quantities import analyse
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.sweep import seeds
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from run_table import missing, open_table

TIMESTEPS = 20
PATHS: dict[str, tuple[str, ...]] = {
    "straight": ("leader.path=straight",),
    "slalom": ("leader.path=slalom", "leader.path_parameters=[step_m=0.03, period=20]"),
}
SCHEDULES = ("turns", "wave", "together", "timer", "timer+delayed")
GROUND = (
    "world.surface_parameters=[size_m=6.0, curvature_per_m=0.02]",
    "start_x_m=1.4",
    "start_y_m=1.5",
    "world.overhead.enabled=false",
    "world.camera.mode=on_demand",
    f"leader.timesteps={TIMESTEPS}",
)


class Task(NamedTuple):
    """One run."""

    path: str
    schedule: str
    followers: int
    seed: int


@dataclass(frozen=True)
class Row:
    """A follower's part of a run; None where unavailable."""

    path: str
    schedule: str
    followers: int
    seed: int
    follower: int
    outcome: str
    formation_error_rmse_m: float | None
    leader_error_rmse_m: float | None
    losses: int
    movements_per_timestep: float | None
    simulated_s: float
    cpu_s: float

    @property
    def task(self) -> Task:
        """The run that it is of."""
        return Task(self.path, self.schedule, self.followers, self.seed)


def build(task: Task) -> scenarios.Scenario:
    """Make a run's scenario."""
    schedule, _, spacing = task.schedule.partition("+")
    settings = [
        *GROUND,
        *PATHS[task.path],
        f"followers={task.followers}",
        f"schedule={schedule}",
        f"spacing={spacing or 'rigid'}",
        f"seed={task.seed}",
    ]
    return scenarios.override(scenarios.load_track("one"), settings)


def run_task(task: Task) -> list[Row]:
    """Carry out one run."""
    began = time.process_time()
    found = analyse(run_in_memory(build(task)))
    cpu_s = time.process_time() - began
    return [
        Row(
            *task,
            follower=number,
            outcome=found.outcome,
            formation_error_rmse_m=follower.totals["formation_error_rmse_m"],
            leader_error_rmse_m=follower.totals["leader_error_rmse_m"],
            losses=len(follower.totals["losses"]),
            movements_per_timestep=follower.totals["movements_per_timestep"],
            simulated_s=float(follower.totals["simulated_seconds"]),
            cpu_s=cpu_s,
        )
        for number, follower in enumerate(found.followers, 1)
    ]


def carry_out(args: argparse.Namespace) -> int:
    """Run what is missing in the table."""
    chosen = [
        Task(path, schedule, followers, seed)
        for seed in seeds(args.seeds)
        for path, schedule, followers in itertools.product(args.paths, args.schedules, args.followers)
    ]
    table, tasks = missing(args.out, Row, chosen)
    for rows in with_progress(run_parallel(run_task, ((task,) for task in tasks), args.jobs), len(tasks)):
        table.append(rows)
    return 0


def ratio(runs: Sequence[Sequence[Row]]) -> str:
    """Geometric mean of the ratio from one follower to the next, over runs that came to their end."""
    logs = []
    for rows in runs:
        errors = [row.formation_error_rmse_m for row in rows]
        if len(rows) > 1 and rows[0].outcome == "done" and errors[0] and errors[-1]:
            logs.append(math.log(errors[-1] / errors[0]) / (len(rows) - 1))
    if not logs:
        return "-"
    draws = np.random.default_rng(0).choice(logs, (2000, len(logs))).mean(axis=1)
    low, high = np.exp(np.quantile(draws, [0.025, 0.975]))
    return f"{math.exp(float(np.mean(logs))):.2f} ({low:.2f}..{high:.2f})"


def report(args: argparse.Namespace) -> int:
    """Print the table."""
    grouped: dict[tuple[str, str, int], dict[int, list[Row]]] = {}
    for row in open_table(args.out, Row).read():
        case = grouped.setdefault((row.path, row.schedule, row.followers), {})
        case.setdefault(row.seed, []).append(row)
    print("| path | schedule | N | runs | not done | error of follower 1, middle, N, cm | ratio per robot | "
          "simulated s | processor s |")  # fmt: skip
    print("|---" * 9 + "|")
    for (path, schedule, count), runs in sorted(grouped.items()):
        done = [rows for rows in runs.values() if rows[0].outcome == "done"]
        shown = []
        for number in sorted({0, (count - 1) // 2, count - 1}):
            errors = [100.0 * (rows[number].formation_error_rmse_m or math.inf) for rows in done]
            shown.append(f"{np.median(errors):.2f}" if errors else "-")
        times = [
            f"{np.median([getattr(rows[0], name) for rows in done]) / TIMESTEPS:.2f}" if done else "-"
            for name in ("simulated_s", "cpu_s")
        ]
        print(f"| {path} | {schedule} | {count} | {len(runs)} | {len(runs) - len(done)} | {', '.join(shown)} | "
              f"{ratio(list(runs.values()))} | {times[0]} | {times[1]} |")  # fmt: skip
    return 0


def main() -> int:
    """Run or report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(required=True)
    runner = verbs.add_parser("run", help="carry out what is missing")
    runner.add_argument("out", type=Path)
    runner.add_argument("--seeds", default="0:5")
    runner.add_argument("--followers", type=lambda text: [int(n) for n in text.split(",")], default=[1, 2, 3, 5, 10])
    runner.add_argument("--schedules", type=lambda text: text.split(","), default=list(SCHEDULES))
    runner.add_argument("--paths", type=lambda text: text.split(","), default=list(PATHS))
    runner.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    runner.set_defaults(run=carry_out)
    reporter = verbs.add_parser("report", help="print the table")
    reporter.add_argument("out", type=Path)
    reporter.set_defaults(run=report)
    args = parser.parse_args()
    found: int = args.run(args)
    return found


if __name__ == "__main__":
    raise SystemExit(main())
