"""Long runs: does time per timestep or memory grow? In one process, or through the node graph with --graph.

Track one's robots, the leader on a circle of twelve timesteps with its heading kept, camera on demand, recorded into a
bag and analysed. Printed per tenth of the run: seconds per timestep (processor time in one process, wall time with
--graph), and memory (resident set in one process, proportional set size of all processes with --graph); then time and
memory of the analysis. The first tenth has the first alignment in it, so the last tenth is compared with the second:
time per timestep and memory may be 1.25 times as much, else the exit code is 1.

Run: python bench/long_run.py [--timesteps 1000] [--graph] [--json]
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from graph_memory import graph_mb
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching.launcher import Launcher
from robot_formation.launching.processes import run_metadata

TENTHS = 10
MOST_GROWTH = 1.25
SETTINGS = ("seed=3", "leader.path=circle", "leader.path_parameters=[period=12]", "world.camera.mode=on_demand")
ANALYSIS = """
import resource, sys, time
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
began = time.perf_counter()
found = analyse(load_run(sys.argv[1]))
assert found.outcome == "done", found.outcome
print(time.perf_counter() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


def resident_mb() -> float:
    """Return the resident set of this process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


class Watch:
    """Takes the run's lines of progress and notes time and memory at the end of each tenth."""

    def __init__(self, timesteps: int, *, graph: bool) -> None:
        self._every = max(1, timesteps // TENTHS)
        self._memory_mb = graph_mb if graph else resident_mb
        self._clock = time.perf_counter if graph else time.process_time
        self._began = self._clock()
        self.tenths: list[dict[str, float]] = []

    def say(self, text: str) -> None:
        """Take a line."""
        line = re.match(r"timestep +(\d+)/", text)
        if line is None or int(line[1]) % self._every:
            return
        seconds = (self._clock() - self._began) / self._every
        self.tenths.append({"timestep": int(line[1]), "s_per_timestep": seconds, "memory_mb": self._memory_mb()})
        self._began = self._clock()


def driven(scenario: Scenario, bag: Path, *, graph: bool) -> list[dict[str, float]]:
    """Carry out the run; return what was noted per tenth."""
    watch = Watch(scenario.leader.timesteps, graph=graph)
    if graph:
        result = Launcher(scenario, bag, say=watch.say).run()
    else:
        result = run_in_process(scenario, bag, run_metadata(scenario), say=watch.say)
    if result.exit_code != 0:
        raise SystemExit(f"the run ended with {result.exit_code}: {result.reason}")
    return watch.tenths


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--timesteps", type=int, default=1000, help="of the run, at least 20 (default: 1000)")
    parser.add_argument("--graph", action="store_true", help="through the node graph, not in one process")
    parser.add_argument("--json", action="store_true", help="print JSON")
    args = parser.parse_args()
    if args.timesteps < 2 * TENTHS:
        parser.error(f"--timesteps is at least {2 * TENTHS}, not {args.timesteps}")
    scenario = scenarios.override(scenarios.load_track("one"), [*SETTINGS, f"leader.timesteps={args.timesteps}"])
    scenario.check()
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        tenths = driven(scenario, bag, graph=args.graph)
        bag_mb = sum(path.stat().st_size for path in bag.iterdir()) / 1e6
        done = subprocess.run([sys.executable, "-c", ANALYSIS, bag], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"the analysis ended with {done.returncode}; what it said is above")
    analysis_s, analysis_mb = map(float, done.stdout.split())
    growth = {name: tenths[-1][name] / tenths[1][name] for name in ("s_per_timestep", "memory_mb")}
    whole = {"bag_kb_per_timestep": 1e3 * bag_mb / args.timesteps, "analysis_s": analysis_s, "analysis_mb": analysis_mb}
    if args.json:
        print(json.dumps({"tenths": tenths, "growth": growth, **whole}, indent=1))
    else:
        print("| to timestep | s per timestep | memory (MB) |\n|---|---|---|")
        for tenth in tenths:
            print(f"| {tenth['timestep']:.0f} | {tenth['s_per_timestep']:.3f} | {tenth['memory_mb']:.1f} |")
        print("\nlast tenth to second: " + ", ".join(f"{name} {value:.2f}" for name, value in growth.items()))
        print(", ".join(f"{name} {value:.1f}" for name, value in whole.items()))
    return int(max(growth.values()) > MOST_GROWTH)


if __name__ == "__main__":
    sys.exit(main())
