"""Correction distance, formation error and losses of each predictor over seeds, on both tracks of the paper.

In-process runs with the camera on demand and the fine-tuner in mode 'paper'. The reduction is design's: the median over
seeds of the paired 1 - C / C_previous, where a lost run ranks worst and is never left out; its 95 % interval is a
percentile bootstrap over seeds (2000 resamples).

Run: python bench/predictors.py [--seeds 100:130] [--jobs 2] [--json]
"""

import argparse
import json
import math
import random
import statistics
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process

TRACKS = ("one", "two")
PREDICTORS = ("previous", "literal", "measured")


def one_run(task):
    track, predictor, seed = task
    settings = [f"seed={seed}", f"predictor.name={predictor}", "world.camera.mode=on_demand"]
    scenario = scenarios.override(scenarios.load_track(track), settings)
    with tempfile.TemporaryDirectory() as folder:
        result = run_in_process(scenario, Path(folder) / "bag", {})
        totals = analyse(load_run(Path(folder) / "bag")).to_json()["totals"]
    return {
        "lost": result.exit_code == 3,
        "correction_m": totals["correction_m"],
        "rmse_m": totals["formation_error_rmse_m"],
        "movements": totals["movements_per_timestep"],
    }


def median(values):
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else math.nan


def reductions(runs, baseline):
    """Paired reductions, one per seed; minus infinity stands for a lost run."""
    paired = []
    for run, base in zip(runs, baseline, strict=True):
        if run["lost"]:
            paired.append(-math.inf)
        elif not base["lost"] and base["correction_m"]:
            paired.append(1.0 - run["correction_m"] / base["correction_m"])
    return paired


def interval(values):
    """95 % percentile bootstrap interval of the median."""
    draw = random.Random(0)
    medians = sorted(statistics.median(draw.choices(values, k=len(values))) for _ in range(2000))
    return medians[49], medians[1949]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="100:130", help="FIRST:END")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    seeds = range(*map(int, args.seeds.split(":")))
    tasks = [(track, predictor, seed) for track in TRACKS for predictor in PREDICTORS for seed in seeds]
    with ProcessPoolExecutor(args.jobs) as pool:
        runs = []
        for number, run in enumerate(pool.map(one_run, tasks, chunksize=4), 1):
            runs.append(run)
            print(f"\r{number}/{len(tasks)} runs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    by_task = dict(zip(tasks, runs, strict=True))
    found = []
    for track in TRACKS:
        baseline = [by_task[track, "previous", seed] for seed in seeds]
        for predictor in PREDICTORS:
            group = [by_task[track, predictor, seed] for seed in seeds]
            paired = reductions(group, baseline)
            low, high = interval(paired)
            found.append(
                {
                    "track": track,
                    "predictor": predictor,
                    "runs": len(group),
                    "correction_cm": 100 * median([run["correction_m"] for run in group]),
                    "reduction": statistics.median(paired),
                    "low": low,
                    "high": high,
                    "rmse_cm": 100 * median([run["rmse_m"] for run in group]),
                    "movements_per_timestep": median([run["movements"] for run in group]),
                    "lost": sum(run["lost"] for run in group),
                }
            )
    if args.json:
        print(json.dumps(found, indent=2))
        return
    names = list(found[0])
    print("| " + " | ".join(names) + " |\n|" + "---|" * len(names))
    for row in found:
        print(
            "| "
            + " | ".join(f"{value:.2f}" if isinstance(value, float) else str(value) for value in row.values())
            + " |"
        )


if __name__ == "__main__":
    main()
