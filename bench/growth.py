"""How a run's bag grows with its timesteps. The aim is 400 timesteps in at most 15 MB.

Track one on the bowl in process, with steps of the leader so small that the robots stay on the plate. Prints the bag's
size by number of timesteps, and ends with 1 if it is larger than that.

Run: python bench/growth.py [--timesteps 100,200,400] [--json]
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from comparison import Comparison, add_comparisons, as_json
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process
from robot_formation.launching.processes import run_metadata

AIM_MB = 15.0
AIM_TIMESTEPS = 400
SETTINGS = ("leader.step_m=0.004",)


def bag_mb(timesteps: int, folder: Path) -> float:
    scenario = scenarios.override(scenarios.load_track("one"), [*SETTINGS, f"leader.timesteps={timesteps}"])
    bag = folder / f"bag_{timesteps}"
    result = run_in_process(scenario, bag, run_metadata(scenario))
    if result.exit_code != 0:
        raise SystemExit(f"the run of {timesteps} timesteps ended with {result.exit_code}: {result.reason}")
    return sum(path.stat().st_size for path in bag.iterdir()) / 1e6


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--timesteps", default="100,200,400", help="numbers of timesteps, separated by commas")
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_comparisons(parser)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sizes = {number: bag_mb(number, Path(folder)) for number in map(int, args.timesteps.split(","))}
    if args.comparisons:
        most = max(sizes)
        print(as_json([Comparison(f"bag of {most} timesteps", sizes[most], AIM_MB * most / AIM_TIMESTEPS, "MB")]))
    elif args.json:
        print(json.dumps({number: {"mb": mb, "mb_per_timestep": mb / number} for number, mb in sizes.items()}))
    else:
        print("| timesteps | bag (MB) | per timestep (MB) |\n|---|---|---|")
        for number, mb in sizes.items():
            print(f"| {number} | {mb:.1f} | {mb / number:.3f} |")
    return int(any(mb > AIM_MB for number, mb in sizes.items() if number <= AIM_TIMESTEPS))


if __name__ == "__main__":
    sys.exit(main())
