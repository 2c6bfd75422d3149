"""Runs every bench that compares with a peer or a limit, and writes one table: figures, ratios, machine and commit.

A ratio above 1 means better than the peer, or within the limit. Each bench runs in a process of its own, one after the
other; close other programs first. Twenty minutes on two cores; --quick takes few rounds, for a first look.

Run: python bench/all.py [--quick] [--only NAME,...] [--out FILE.md]
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from comparison import Comparison, from_json, markdown
from robot_formation.system.git_commit import git_commit

BENCH = Path(__file__).resolve().parent
BENCHES: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "detector": ((), ("--rounds", "3")),
    "world": ((), ("--rounds", "3")),
    "predictor": ((), ("--rounds", "5")),
    "executors": ((), ("--messages", "1000")),
    "sweep": (("--runs", "40", "--rounds", "3"), ("--runs", "6")),
    "run": ((), ("--rounds", "1")),
    "growth": ((), ("--timesteps", "20,40")),
    "bags": ((), ("--seconds", "1")),
    "viewing": (("--rounds", "3"), ("--rounds", "1", "--timesteps", "50")),
}
"""Arguments of each bench that prints --comparisons: for the whole measurement, and for a quick one."""


def measured(name: str, arguments: Sequence[str]) -> list[Comparison]:
    """Run a bench.

    Raises:
        ValueError: if it fails, or prints no comparisons.
    """
    command = [sys.executable, str(BENCH / f"{name}.py"), "--comparisons", *arguments]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    try:
        return from_json(done.stdout)
    except ValueError:
        last = (done.stderr or done.stdout).strip().rpartition("\n")[2]
        raise ValueError(f"exit code {done.returncode}, {last}") from None


def processor() -> str:
    """Return the processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def heading() -> list[str]:
    """Say on what the figures were measured."""
    cores = len(os.sched_getaffinity(0))
    machine = f"{processor()}, {cores} cores, Python {platform.python_version()}, {platform.system()}"
    return [
        "# Measured figures beside peers and limits",
        "",
        f"{time.strftime('%Y-%m-%d')}, commit {git_commit(10) or 'unknown'}, {machine}. Ratios above 1: better.",
        "",
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few rounds, for a first look")
    parser.add_argument("--only", type=lambda text: text.split(","), default=list(BENCHES), metavar="NAME,...")
    parser.add_argument("--out", type=Path, help="write the table to this file too")
    args = parser.parse_args()
    if unknown := [name for name in args.only if name not in BENCHES]:
        print(f"--only: no bench {unknown[0]!r}; there are {', '.join(BENCHES)}", file=sys.stderr)
        return 2
    rows: list[tuple[str, Comparison]] = []
    failed = []
    for name in args.only:
        print(f"{name} ...", file=sys.stderr, flush=True)
        try:
            rows += [(name, comparison) for comparison in measured(name, BENCHES[name][args.quick])]
        except ValueError as error:
            failed.append(f"{name}: {error}")
    text = "\n".join([*heading(), *markdown(rows)]) + "\n"
    print(text, end="")
    if args.out is not None:
        args.out.write_text(text, encoding="utf-8")
    for line in failed:
        print(line, file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
