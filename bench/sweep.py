"""Throughput of the sweep: runs per minute with one job and with two, in the same run, and how it scales.

Runs of track two on the bowl with the predictor `formation`: the real detector on real pictures, and pictures only when
one is waited for. The worker processes are started and warm before anything is timed. One job and two take turns, so
that the machine's load changes both alike; each figure is the median over the rounds, the scaling the median of the
rounds' own ratios. Twice as many runs per minute is the most that two jobs can reach.

Run: python bench/sweep.py [--runs N] [--rounds N] [--json]
"""

import argparse
import json
import statistics
import time
from collections.abc import Iterable
from typing import Any

from comparison import Comparison, add_comparisons, as_json
from robot_formation.experiment import sweep, sweep_runs

AIM = 240.0
JOBS = (1, 2)


def plan(seeds: Iterable[int]) -> sweep.Plan:
    return sweep.Plan(("two",), ("bowl",), ("formation",), tuple(seeds))


def runs_per_minute(count: int, jobs: int) -> float:
    began = time.perf_counter()
    rows = list(sweep_runs.carry_out(plan(range(count)).tasks(), (), jobs))
    minutes = (time.perf_counter() - began) / 60.0
    lost = sum(row.lost for row in rows)
    if lost:
        raise SystemExit(f"{lost} of {count} runs were lost: their time says nothing")
    return count / minutes


def warm_up() -> None:
    for jobs in JOBS:
        list(sweep_runs.carry_out(plan(range(2 * jobs)).tasks(), ("leader.timesteps=1",), jobs))


def measure(count: int, rounds: int) -> dict[str, Any]:
    warm_up()
    found = [{jobs: runs_per_minute(count, jobs) for jobs in JOBS} for _ in range(rounds)]
    return {
        "runs": count,
        "rounds": rounds,
        "runs_per_minute": {str(jobs): statistics.median(r[jobs] for r in found) for jobs in JOBS},
        "scaling": statistics.median(r[2] / r[1] for r in found),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=12, help="runs per job count and round")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    add_comparisons(parser)
    args = parser.parse_args()
    found = measure(args.runs, args.rounds)
    if args.comparisons:
        one, two = (found["runs_per_minute"][str(jobs)] for jobs in JOBS)
        rates = Comparison("runs with two jobs", two, AIM, "per minute", larger_is_better=True)
        print(as_json([rates, Comparison("two jobs", two, one, "runs per minute", "one job", larger_is_better=True)]))
        return
    if args.json:
        print(json.dumps(found, indent=2))
        return
    for jobs, rate in found["runs_per_minute"].items():
        print(f"{jobs} job(s): {rate:6.1f} runs per minute, {rate / AIM:.2f} of the aim of {AIM:g}")
    print(f"scaling from one job to two: {found['scaling']:.2f}")


if __name__ == "__main__":
    main()
