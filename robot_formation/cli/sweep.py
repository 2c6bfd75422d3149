"""`formation sweep`: many runs over tracks, surfaces, predictors and seeds, and what they say together."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_formation import exit_codes
from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.bag.place import PathReservation
    from robot_formation.experiment import sweep

DESCRIPTION = """\
Run every combination of tracks, surfaces, predictors and seeds in process (camera on demand; fine-tuner in mode
'paper', unless --set fine_tuner.mode=precise), and compare the predictors: medians with 95 % bootstrap intervals,
paired over seeds. The table of runs grows in OUT/runs.csv; a sweep that was stopped goes on there when the same command
is given again. Besides the predictors of 'formation list', 'ideal' and 'ideal+close' show the noise floor: the same
controller, commanded the ideal move.
"""
SUMMARY_NAME = "summary.json"
TABLE_NAME = "summary.md"


def add_parser(subparsers: Any) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("sweep", help="compare predictors over many runs", description=DESCRIPTION)
    parser.add_argument("--tracks", metavar="NAME,...", default="one,two", help="preset tracks (default: one,two)")
    parser.add_argument("--surfaces", metavar="NAME,...", default="bowl", help="surfaces (default: bowl)")
    parser.add_argument(
        "--predictors",
        metavar="NAME,...",
        default="previous,measured,formation",
        help="predictors (default: previous,measured,formation)",
    )
    parser.add_argument("--seeds", metavar="FIRST:END", default="0:20", help="seeds FIRST to END - 1 (default: 0:20)")
    parser.add_argument("--jobs", metavar="N", type=int, default=os.cpu_count() or 1, help="runs at the same time")
    parser.add_argument("--dask", metavar="SCHEDULER", help="address of a Dask scheduler, instead of --jobs")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of the results (default: a new one in bags/)")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="any parameter, for all runs; may be repeated"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Sweep and print the summary; return 0, or 130 when interrupted.

    Raises:
        FormationError: on anything wrong in the arguments or the folder, before anything is run.
    """
    from robot_formation.experiment import sweep

    plan = sweep.Plan(
        _names(args.tracks), _names(args.surfaces), _names(args.predictors), seeds(args.seeds), tuple(args.set)
    )
    if args.jobs < 1:
        raise FormationError(f"--jobs is at least 1, not {args.jobs}")
    plan.check()
    if args.out is not None:
        return _sweep(args, plan, args.out)
    with default_folder() as place:
        return _sweep(args, plan, place.path)


def _sweep(args: argparse.Namespace, plan: sweep.Plan, folder: Path) -> int:
    from robot_formation.analysis.sweep_summary import summarise, table
    from robot_formation.experiment import sweep

    results = sweep.Table(folder, plan)
    tasks = sweep.remaining(plan, results.rows)
    done = len(results.rows)
    if tasks:
        if done:
            print(f"{folder}: {done} runs are there already, {len(tasks)} are left", file=sys.stderr)
        rows = (
            sweep.carry_out_by_dask(tasks, plan.settings, args.dask)
            if args.dask
            else sweep.carry_out(tasks, plan.settings, min(args.jobs, len(tasks)))
        )
        try:
            for row in with_progress(rows, len(tasks)):
                results.add(row)
        except KeyboardInterrupt:
            print(f"\nformation sweep: interrupted; the same command with --out {folder} goes on", file=sys.stderr)
            return exit_codes.INTERRUPTED
    summary = summarise(sweep.chosen(plan, results.rows))
    (folder / SUMMARY_NAME).write_text(json.dumps({"summary": summary}, indent=2) + "\n", encoding="utf-8")
    (folder / TABLE_NAME).write_text(table(summary) + "\n", encoding="utf-8")
    if args.json:
        print(json.dumps({"runs": str(folder / sweep.RUNS_NAME), "summary": summary}, indent=2))
    else:
        print(table(summary))
        print(f"\nruns: {folder / sweep.RUNS_NAME}\nsummary: {folder / SUMMARY_NAME}")
    return exit_codes.DONE


def seeds(text: str) -> tuple[int, ...]:
    """Read FIRST:END, or one seed.

    Raises:
        FormationError: on anything else, or an empty range.
    """
    match = re.fullmatch(r"(\d{1,18})(?::(\d{1,18}))?", text)
    if match is None:
        raise FormationError(f"--seeds takes FIRST:END, like 0:200, not '{text}'")
    first = int(match[1])
    end = int(match[2]) if match[2] else first + 1
    if end <= first:
        raise FormationError(f"--seeds {text} holds no seed: END is not among them")
    if end - first > 1_000_000:
        raise FormationError(f"--seeds {text} are more than a million")
    return tuple(range(first, end))


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def default_folder() -> PathReservation:
    """Name a new folder after the time, and reserve the name."""
    from robot_formation.bag.place import reserve_new
    from robot_formation.paths import default_bags_dir

    return reserve_new(default_bags_dir(), f"sweep_{time.strftime('%Y%m%d-%H%M%S')}")


def with_progress(rows: Iterable[Any], count: int, what: str = "runs") -> Iterator[Any]:
    """Pass rows on and tell standard error how many there are, how fast they come and how long the rest will take."""
    began = last = time.monotonic()
    terminal = sys.stderr.isatty()
    for number, row in enumerate(rows, 1):
        yield row
        now = time.monotonic()
        if now - last < (0.5 if terminal else 10.0) and number < count:
            continue
        last = now
        rate = number / max(now - began, 1e-9)
        left = (count - number) / rate
        text = f"{number}/{count} {what}, {60.0 * rate:.0f} per minute, {_duration(left)} left"
        print(f"\r{text:<60}" if terminal else text, end="" if terminal and number < count else "\n", file=sys.stderr)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
