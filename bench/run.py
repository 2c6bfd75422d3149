"""What a run of track two costs: wall time, real-time factor, share by node, memory, bag size.

In both camera modes through the node graph and in one process, each several times; the median is printed. The aims are
those of the project: `stream` at 10 times real time, `on_demand` at 20, in process below 1.3 seconds; 350 MB.

Memory is that of all processes when the last timestep is done: of the node graph the proportional set sizes of nodes
and launcher, each run in a process of its own; of one process its peak.

Run: python bench/run.py [--rounds N] [--predictor NAME] [--json]
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from comparison import Comparison, add_comparisons, as_json
from robot_formation.analysis.from_bag import load_run

AIMS = {"stream": 10.0, "on_demand": 20.0}
START_AIM_S, END_AIM_S, IN_PROCESS_AIM_S, MEMORY_AIM_MB = 1.5, 0.3, 1.3, 350.0
IN_PROCESS = """
import os, resource, sys, time
from pathlib import Path
from robot_formation.system.garbage import rare_collections
from robot_formation.system.threads import one_thread
os.environ.update(one_thread(os.environ))  # as `formation run` begins
with rare_collections():
    from robot_formation.cli.run import import_before_the_users
    import_before_the_users(in_process=True, own_process=True)
    from robot_formation.experiment import scenario as scenarios
    from robot_formation.experiment.in_process import run_in_process
    from robot_formation.launching.processes import run_metadata
    scenario = scenarios.override(scenarios.load_track("two"), sys.argv[2:])
    result = run_in_process(scenario, Path(sys.argv[1]), run_metadata(scenario))
print(result.running_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
sys.exit(result.exit_code)
"""


THROUGH_THE_GRAPH = """
import json, os, sys, time
from pathlib import Path
sys.path.append(sys.argv[2])
from graph_memory import nodes_mb, set_size_mb
from robot_formation.experiment import scenario as scenarios
from robot_formation.launching.launcher import Launcher
scenario = scenarios.override(scenarios.load_track("two"), sys.argv[3:])
last, memory_mb = f"{scenario.leader.timesteps}/{scenario.leader.timesteps}", {}
def say(text):
    if text.startswith("timestep") and last in text:
        memory_mb.update({**nodes_mb(), "launcher": set_size_mb(os.getpid())})
began = time.monotonic()
result = Launcher(scenario, Path(sys.argv[1]), say=say).run()
wall_s = time.monotonic() - began
processor_s = {name: usage.processor_s for name, usage in result.usage.items()}
print(json.dumps([wall_s, result.startup_s, result.stopping_s, processor_s, memory_mb]))
print(result.reason, file=sys.stderr)
sys.exit(result.exit_code)
"""


def size_mb(bag: Path) -> float:
    return sum(path.stat().st_size for path in bag.iterdir()) / 1e6


def through_the_graph(settings: Sequence[str], folder: Path) -> dict[str, Any]:
    bag = folder / "bag"
    here = Path(__file__).parent
    command = [sys.executable, "-c", THROUGH_THE_GRAPH, str(bag), str(here), *settings]
    completed = subprocess.run(command, capture_output=True, text=True, check=False)
    if completed.returncode != 0:
        raise SystemExit(f"the run ended with {completed.returncode}: {completed.stderr.strip()}")
    wall_s, startup_s, stopping_s, usage, memory_mb = json.loads(completed.stdout)
    simulated_s = load_run(bag).simulated_s
    processor_s = sum(usage.values())
    return {
        "wall_s": wall_s,
        "startup_s": startup_s,
        "stopping_s": stopping_s,
        "simulated_s": simulated_s,
        "processor_s": processor_s,
        "share": {name: used_s / processor_s for name, used_s in usage.items()},
        "memory_mb": sum(memory_mb.values()),
        "memory": memory_mb,
        "bag_mb": size_mb(bag),
    }


def in_process(settings: Sequence[str], folder: Path) -> dict[str, Any]:
    bag = folder / "bag"
    began = time.monotonic()
    completed = subprocess.run(
        [sys.executable, "-c", IN_PROCESS, bag, *settings], capture_output=True, text=True, check=True
    )
    wall_s = time.monotonic() - began
    driving_s, memory_mb = map(float, completed.stdout.split())
    simulated_s = load_run(bag).simulated_s
    return {
        "wall_s": wall_s,
        "driving_s": driving_s,
        "simulated_s": simulated_s,
        "real_time_factor": simulated_s / driving_s,
        "memory_mb": memory_mb,
        "bag_mb": size_mb(bag),
    }


def median_of(rounds: Sequence[dict[str, Any]]) -> dict[str, Any]:
    def median(name: str) -> Any:
        if isinstance(rounds[0][name], dict):
            # Of a process that was starting or ending when memory was at its most there is none in that round.
            nodes = dict.fromkeys(node for r in rounds for node in r[name])
            return {node: statistics.median(r[name].get(node, 0.0) for r in rounds) for node in nodes}
        return statistics.median(r[name] for r in rounds)

    return {name: median(name) for name in rounds[0]}


def add_real_time_factor(found: Mapping[tuple[str, str], Sequence[dict[str, Any]]]) -> None:
    """From start to end less the fastest start of all rounds.

    The first sign of life reaches the launcher late if discovery is slow, so a round's own start would flatter it.
    """
    graph = [r for (name, _), values in found.items() for r in values if name == "through_the_graph"]
    startup_s = min(r["startup_s"] for r in graph)
    for r in graph:
        r["driving_s"] = r["wall_s"] - r["stopping_s"] - startup_s
        r["real_time_factor"] = r["simulated_s"] / r["driving_s"]


def measure(rounds: int, predictor: str) -> dict[str, dict[str, Any]]:
    ways = {(way.__name__, mode): way for way in (through_the_graph, in_process) for mode in AIMS}
    found: dict[tuple[str, str], list[dict[str, Any]]] = {key: [] for key in ways}
    for _ in range(rounds):
        for (name, mode), way in ways.items():
            settings = [f"world.camera.mode={mode}", f"predictor.name={predictor}"]
            with tempfile.TemporaryDirectory() as folder:
                found[name, mode].append(way(settings, Path(folder)))
    add_real_time_factor(found)
    return {f"{name} {mode}": median_of(values) for (name, mode), values in found.items()}


def comparisons(found: Mapping[str, Mapping[str, float]]) -> Iterator[Comparison]:
    """Yield what has an aim."""
    for mode, aim in AIMS.items():
        graph = found[f"through_the_graph {mode}"]
        factor = graph["real_time_factor"]
        yield Comparison(f"run through the graph, {mode}", factor, aim, "times real time", larger_is_better=True)
        yield Comparison(f"start of the graph, {mode}", graph["startup_s"], START_AIM_S, "s")
        yield Comparison(f"end of the graph, {mode}", graph["stopping_s"], END_AIM_S, "s")
        yield Comparison(f"memory of the graph, {mode}", graph["memory_mb"], MEMORY_AIM_MB, "MB")
    yield Comparison("run in process, on_demand", found["in_process on_demand"]["wall_s"], IN_PROCESS_AIM_S, "s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--predictor", default="formation", help="of all runs (default: formation)")
    parser.add_argument("--json", action="store_true")
    add_comparisons(parser)
    args = parser.parse_args()
    found = measure(args.rounds, args.predictor)
    if args.comparisons:
        print(as_json(comparisons(found)))
        return
    if args.json:
        print(json.dumps(found, indent=2))
        return
    columns: tuple[str, ...] = (
        "wall_s",
        "startup_s",
        "driving_s",
        "stopping_s",
        "simulated_s",
        "real_time_factor",
        "processor_s",
    )
    columns += ("memory_mb", "bag_mb")
    print(f"{'':28}" + "".join(f"{name:>18}" for name in columns))
    for name, values in found.items():
        print(f"{name:28}" + "".join(f"{values[c]:18.2f}" if c in values else f"{'-':>18}" for c in columns))
    for mode, aim in AIMS.items():
        factor = found[f"through_the_graph {mode}"]["real_time_factor"]
        print(f"{mode}: {factor:.1f} times real time, {factor / aim:.2f} of the aim of {aim:g}")
        shares = sorted(found[f"through_the_graph {mode}"]["share"].items(), key=lambda item: -item[1])
        print("  processor time: " + ", ".join(f"{name} {share:.0%}" for name, share in shares))
        sizes = sorted(found[f"through_the_graph {mode}"]["memory"].items(), key=lambda item: -item[1])
        print("  memory (MB): " + ", ".join(f"{name} {size:.0f}" for name, size in sizes))


if __name__ == "__main__":
    main()
