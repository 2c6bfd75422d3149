"""Formations of N followers by schedule and spacing: errors along the chain, string stability, and times.

Each run is one ground, leader's path, schedule, number of followers and seed, in process, camera on demand. Grounds:
track_one and track_two are the presets (plate of 1.78 m, bowl of 0.2 1/m), flat_bowl is 2.6 m wide with 0.06 1/m,
six_metres 6 m wide with 0.02 1/m. OUT/runs.csv grows run by run, one row per follower, and the same command goes on
where it was stopped. A run that ended early counts as not done.

`report` prints Markdown tables: medians over seeds of the first, the middle and the last follower; ratios from one
follower to the next as geometric means with 95 % bootstrap intervals over seeds, "unstable" where the interval lies
above 1; gains at the leader's dominant frequencies; times. `figure` draws the errors along the longest chain of each
schedule beside the theory for persistence, and the simulated time per timestep over N.

    python bench/chain.py run OUT --followers 1,2,3,5,8,10 --seeds 0:5 [--schedules turns,timer+delayed]
    python bench/chain.py report OUT
    python bench/chain.py figure OUT FILE.png [--path straight]
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from chain_tables import LATE, Row, Task, cases_of, draw, errors_table, gains_table, stability_table, times_table
from robot_formation.analysis.quantities import FollowerAnalysis, RunAnalysis, analyse
from robot_formation.batch.pool import run_parallel
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.sweep import seeds
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory
from run_table import missing, open_table

COMMON = ("world.overhead.enabled=false", "world.camera.mode=on_demand")
FLAT_BOWL = ("world.surface_parameters=[size_m=2.6, curvature_per_m=0.06]", "start_x_m=0.82", "start_y_m=0.9")
SIX_METRES = ("world.surface_parameters=[size_m=6.0, curvature_per_m=0.02]", "start_x_m=1.4", "start_y_m=1.5")
GROUNDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "track_one": ("one", ()),
    "track_two": ("two", ()),
    "flat_bowl": ("one", FLAT_BOWL),
    "six_metres": ("one", SIX_METRES),
}
"""Preset and settings by name."""
PATHS: dict[str, tuple[str, ...]] = {
    "straight": ("straight",),
    "slalom": ("slalom", "step_m=0.03", "period=20"),
    "speed_step": ("speed_step", "before=8"),
    "stop": ("stop", "before=8", "standing=4"),
    "chirp": ("chirp", "period=16", "last_period=4", "sweep=20"),
    "pulse": ("pulse", "step_m=0.03", "period=12"),
    "circle": ("circle", "period=12"),
    "lemniscate": ("lemniscate",),
    "random_walk": ("random_walk",),
}
"""The path's name, then its parameters."""
CHAIN_PATHS = ("straight", "slalom", "speed_step", "stop", "chirp")
SCHEDULES = ("turns", "wave", "together", "together+delayed", "timer", "timer+delayed")


def timesteps(task: Task) -> int:
    """Return how many a run has: 20, or 30 of a path that stays near its start on a small ground."""
    return 20 if task.path == "straight" or task.ground == "six_metres" else 30


def build(task: Task, more: Sequence[str] = ()) -> scenarios.Scenario:
    """Make a run's scenario, with more settings KEY=VALUE."""
    track, ground = GROUNDS[task.ground]
    path, *parameters = PATHS[task.path]
    schedule, _, spacing = task.schedule.partition("+")
    settings = [
        *COMMON,
        *ground,
        f"leader.timesteps={timesteps(task)}",
        f"leader.path={path}",
        f"leader.path_parameters=[{', '.join(parameters)}]",
        f"followers={task.followers}",
        f"schedule={schedule}",
        f"spacing={spacing or 'rigid'}",
        f"seed={task.seed}",
        *more,
    ]
    return scenarios.override(scenarios.load_track(track), settings)


def run_task(task: Task, more: Sequence[str] = ()) -> list[Row]:
    """Carry out one run."""
    scenario = build(task, more)
    scenario.check()
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    record = run_in_memory(scenario)
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    ends_ns = [[each.stamp_ns for each in follower.displacements] for follower in record.followers]
    steps_s = [(ends[-1] - ends[0]) / 1e9 / (len(ends) - 1) if len(ends) > 1 else math.nan for ends in ends_ns]
    return rows_of(task, analyse(record), steps_s, cpu_s, wall_s)


def rows_of(task: Task, run: RunAnalysis, steps_s: list[float], cpu_s: float, wall_s: float) -> list[Row]:
    """Return a run's rows, one per follower."""
    chain = run.string_stability or {"hops": [], "gains": []}
    hops = {hop["robot"]: hop for hop in chain["hops"]}
    return [
        Row(
            *task,
            follower=number,
            outcome=run.outcome,
            timesteps=timesteps(task),
            formation_error_late_rmse_m=late_rmse_m(follower),
            error_ratio_l2=hops.get(follower.name, {}).get("error_ratio_l2"),
            error_ratio_linf=hops.get(follower.name, {}).get("error_ratio_linf"),
            gains=" ".join(
                f"{gain['axis']}{gain['period']:.1f}={gain['hops'][number - 1]:.4f}"
                for gain in chain["gains"]
                if gain["hops"][number - 1]
            ),
            losses=len(follower.totals["losses"]),
            simulated_s=float(follower.totals["simulated_seconds"]),
            step_s=steps_s[number - 1],
            cpu_s=cpu_s,
            wall_s=wall_s,
            **{name: follower.totals[name] for name in TOTALS},
        )
        for number, follower in enumerate(run.followers, 1)
    ]


TOTALS = (
    "formation_error_rmse_m",
    "formation_error_max_m",
    "formation_error_moving_max_m",
    "leader_error_rmse_m",
    "gap_min_m",
    "touches",
    "movements_per_timestep",
)
"""Columns that are totals of the same names."""


def late_rmse_m(follower: FollowerAnalysis) -> float | None:
    """Root mean square formation error from timestep `LATE` on; None if it did not come so far."""
    errors = [timestep.formation_error_m for timestep in follower.timesteps[LATE - 1 :]]
    known = [error for error in errors if error is not None]
    return math.sqrt(float(np.mean(np.square(known)))) if known else None


def carry_out(args: argparse.Namespace) -> int:
    """Run what is missing in the table."""
    chosen = [
        Task(ground, path, schedule, followers, seed)
        for seed in seeds(args.seeds)
        for ground, path, schedule, followers in itertools.product(
            args.grounds, args.paths, args.schedules, args.followers
        )
    ]
    table, tasks = missing(args.out, Row, chosen)
    for rows in with_progress(run_parallel(run_task, ((task, args.set) for task in tasks), args.jobs), len(tasks)):
        table.append(rows)
    return 0


def report(args: argparse.Namespace) -> int:
    """Print the tables."""
    cases = cases_of(open_table(args.out, Row).read())
    for made in (errors_table, stability_table, gains_table, times_table):
        print("\n".join(made(cases)))
    return 0


def figure(args: argparse.Namespace) -> int:
    """Draw the figure."""
    print(draw(cases_of(open_table(args.out, Row).read()), args.ground, args.path, args.file))
    return 0


def names(text: str) -> list[str]:
    """Read names separated by commas."""
    return text.split(",")


def main() -> int:
    """Run, report or draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(required=True)
    runner = verbs.add_parser("run", help="carry out what is missing")
    runner.add_argument("out", type=Path)
    runner.add_argument("--seeds", default="0:5")
    runner.add_argument("--followers", type=lambda text: [int(n) for n in text.split(",")], default=[1, 2, 3, 5, 8, 10])
    runner.add_argument("--schedules", type=names, default=list(SCHEDULES))
    runner.add_argument("--paths", type=names, default=list(CHAIN_PATHS))
    runner.add_argument("--grounds", type=names, default=["six_metres"])
    runner.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="in all runs of OUT")
    runner.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    runner.set_defaults(run=carry_out)
    reporter = verbs.add_parser("report", help="print the tables")
    reporter.add_argument("out", type=Path)
    reporter.set_defaults(run=report)
    drawer = verbs.add_parser("figure", help="draw errors along the chain and time per timestep")
    drawer.add_argument("out", type=Path)
    drawer.add_argument("file", type=Path)
    drawer.add_argument("--ground", choices=GROUNDS, default="six_metres")
    drawer.add_argument("--path", choices=PATHS, default="straight")
    drawer.set_defaults(run=figure)
    args = parser.parse_args()
    found: int = args.run(args)
    return found


if __name__ == "__main__":
    raise SystemExit(main())
