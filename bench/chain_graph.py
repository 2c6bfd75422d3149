"""Wall time per timestep of formations of N followers through the node graph.

Each run is `formation run` on the six-metre ground of bench/chain.py, with its four processes per follower, camera on
demand. "Start" is the time until the last follower has done the first timestep: starting the nodes, discovery and the
first alignment. The time per timestep is that from the fourth timestep to the last one, so neither start nor end
counts. Times are compared with those of the first N, and with N times these.

    python bench/chain_graph.py [--followers 1,2,5,10] [--schedules timer+delayed] [--timesteps 20] [--rounds 2]
"""

from __future__ import annotations

import argparse
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from chain import COMMON, SIX_METRES

_DONE = re.compile(r"timestep +(\d+)/\d+ +correction")
_FIRST = 4
"""Timesteps before are those of the collection phase."""


class Times(NamedTuple):
    """Wall seconds of a run."""

    start_s: float
    timestep_s: float
    end_s: float


def measure(followers: int, schedule: str, timesteps: int, bag: Path) -> Times:
    """Carry out a run.

    Raises:
        SystemExit: the run failed.
    """
    name, _, spacing = schedule.partition("+")
    settings = [*COMMON, *SIX_METRES, f"followers={followers}", f"leader.timesteps={timesteps}", f"schedule={name}"]
    settings.append(f"spacing={spacing or 'rigid'}")
    command = [sys.executable, "-m", "robot_formation.cli", "run", "--track", "one", "--seed", "0", "--json"]
    command += ["--bag", str(bag), *(part for setting in settings for part in ("--set", setting))]
    began, done = time.monotonic(), {}
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    said = ""
    for said in process.stderr:
        if found := _DONE.search(said):
            done[int(found[1])] = time.monotonic() - began
    if process.wait():
        raise SystemExit(f"{' '.join(command)}: exit code {process.returncode}: {said.strip()}")
    ended = time.monotonic() - began
    last = done[timesteps]
    return Times(done[1], (last - done[_FIRST]) / (timesteps - _FIRST), ended - last)


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--followers", type=lambda text: [int(n) for n in text.split(",")], default=[1, 2, 5, 10])
    parser.add_argument("--schedules", type=lambda text: text.split(","), default=["timer+delayed"])
    parser.add_argument("--timesteps", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=2)
    args = parser.parse_args()
    if args.timesteps <= _FIRST:
        parser.error(f"--timesteps must be above {_FIRST}")
    print("| schedule | followers | start, s | s a timestep | end, s | times the first's | the same by N |")
    print("|---|---|---|---|---|---|---|")
    for schedule in args.schedules:
        first: tuple[int, float] | None = None
        for followers in args.followers:
            runs = []
            for _ in range(args.rounds):
                with tempfile.TemporaryDirectory() as folder:
                    runs.append(measure(followers, schedule, args.timesteps, Path(folder) / "bag"))
            start, timestep, end = (statistics.median(values) for values in zip(*runs, strict=True))
            first = first or (followers, timestep)
            ratio = timestep / first[1]
            row = (schedule, followers, f"{start:.1f}", f"{timestep:.3f}", f"{end:.1f}", f"{ratio:.1f}")
            print("|", " | ".join(map(str, row)), f"| {ratio * first[0] / followers:.2f} |", flush=True)


if __name__ == "__main__":
    main()
