"""How much of a follower's formation error comes from its heading: chains on track one, `turns`, straight leader.

Printed per follower, medians over seeds of the root mean square over a run's timesteps: the formation error, the
heading's error relative to the neighbour's, and what is left of the formation error without the part of v that follows
the heading (linear regression over the timesteps of all runs).

Run: python bench/chain_headings.py [--followers 1,2] [--seeds 0:20] [--jobs N]
"""

import argparse
import math
import os
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chain import build
from chain_tables import Task
from leader_path_tables import print_table
from robot_formation.analysis.quantities import analyse
from robot_formation.batch.pool import run_parallel
from robot_formation.cli.option_types import positive_whole
from robot_formation.cli.sweep import seeds
from robot_formation.experiment.in_memory_record import run_in_memory

Errors = NDArray[np.float64]


def run_task(task: Task) -> list[Errors]:
    """Carry out a run; return per follower u, v [m] and heading [rad] of the error at each timestep, (n, 3)."""
    followers = analyse(run_in_memory(build(task))).followers
    return [
        np.array([(*t.error_uv_m, t.heading_error_rad) for t in follower.timesteps if t.error_uv_m is not None], float)
        for follower in followers
    ]


def rms(values: Errors) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def line(runs: Sequence[Errors]) -> list[str]:
    """Return a follower's cells."""
    _, v, heading = np.concatenate(runs).T
    slope = np.polyfit(heading, v, 1)[0]
    error = np.median([rms(np.hypot(run[:, 0], run[:, 1])) for run in runs])
    turned = np.median([rms(run[:, 2]) for run in runs])
    left = np.median([rms(np.hypot(run[:, 0], run[:, 1] - slope * run[:, 2])) for run in runs])
    return [f"{100 * error:.2f}", f"{math.degrees(turned):.2f}", f"{100 * left:.2f}"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--followers", default="1,2")
    parser.add_argument("--seeds", default="0:20")
    parser.add_argument("--jobs", type=positive_whole, default=os.cpu_count() or 1)
    args = parser.parse_args()
    lines = []
    for count in map(int, args.followers.split(",")):
        tasks = [Task("track_one", "straight", "turns", count, seed) for seed in seeds(args.seeds)]
        runs = list(run_parallel(run_task, ((task,) for task in tasks), args.jobs))
        for number in range(count):
            lines.append([str(count), str(number + 1), *line([run[number] for run in runs])])
    print_table(["N", "follower", "error (cm)", "heading (degrees)", "error without heading's part (cm)"], lines)
    return 0


if __name__ == "__main__":
    sys.exit(main())
