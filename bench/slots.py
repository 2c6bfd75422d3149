"""Which slots a follower can keep: formation error and losses over its offset ahead of its neighbour.

Runs in process, camera on demand, 15 timesteps of a straight leader on the default bowl on a plate of 2.4 m, checks of
the places left out, so that what they refuse is measured too. Per offset: medians over seeds of the worst follower's
formation error (RMSE) and movements per timestep, the largest formation error at the end of a timestep, and runs in
which a follower was lost. With two followers both have the same offset, unless --kink gives the second one another.

Run: python bench/slots.py [--ahead -0.12,-0.05,0.05,0.12] [--seeds 0:5] [--followers 1] [--mode precise] [--jobs 2]
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from statistics import median

from robot_formation.analysis.quantities import analyse
from robot_formation.batch.pool import run_parallel
from robot_formation.cli.sweep import seeds
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_memory_record import run_in_memory

GROUND = (
    "world.surface_parameters=[size_m=2.4]",
    "start_x_m=0.9",
    "start_y_m=0.6",
    "world.overhead.enabled=false",
    "world.camera.mode=on_demand",
)


TOTALS = ("formation_error_rmse_m", "formation_error_max_m", "movements_per_timestep")


@dataclass(frozen=True)
class Found:
    """What a run showed of its worst follower: RMSE and maximum of the formation error [m], movements, outcome."""

    rmse_m: float
    most_m: float
    movements: float
    outcome: str


def run(slots: list[list[float]], mode: str, seed: int, settings: list[str]) -> Found:
    """Carry out one run."""
    chosen = [
        *GROUND,
        f"followers={len(slots)}",
        f"slots={slots}",
        f"seed={seed}",
        f"fine_tuner.mode={mode}",
        *settings,
    ]
    found = analyse(run_in_memory(scenarios.override(scenarios.load_track("one"), chosen)))
    totals = [follower.totals for follower in found.followers]
    rmse_m, most_m, movements = (
        max(math.inf if entry[name] is None else float(entry[name]) for entry in totals) for name in TOTALS
    )
    return Found(rmse_m, most_m, movements, found.outcome)


def main() -> None:
    """Print a line per offset."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--ahead", default=",".join(str(cm / 100) for cm in range(-12, 13, 2)), help="offsets [m]")
    parser.add_argument("--lateral", type=float, default=0.32, help="distance to the neighbour's right [m]")
    parser.add_argument("--kink", type=float, help="offset of the second follower [m]")
    parser.add_argument("--seeds", default="0:5")
    parser.add_argument("--followers", type=int, default=1)
    parser.add_argument("--mode", default="precise")
    parser.add_argument("--set", action="append", default=[], help="further settings of the scenario")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    offsets = [float(text) for text in args.ahead.split(",")]
    tasks = []
    for ahead_m in offsets:
        slots = [[args.lateral, ahead_m]] * args.followers
        slots[1:2] = [[args.lateral, args.kink]] if args.kink is not None else slots[1:2]
        tasks += [(slots, args.mode, seed, args.set) for seed in seeds(args.seeds)]
    found = list(run_parallel(run, tasks, args.jobs))
    print("ahead cm   RMSE cm   most cm   movements   lost")
    for number, ahead_m in enumerate(offsets):
        count = len(tasks) // len(offsets)
        runs = found[number * count : (number + 1) * count]
        print(
            f"{100 * ahead_m:8.1f} {100 * median(one.rmse_m for one in runs):9.2f} "
            f"{100 * max(one.most_m for one in runs):9.2f} {median(one.movements for one in runs):11.2f} "
            f"{sum(one.outcome != 'done' for one in runs):3d} of {count}"
        )


if __name__ == "__main__":
    main()
