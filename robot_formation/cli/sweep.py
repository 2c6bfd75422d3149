"""`formation sweep`: many runs over tracks, paths, surfaces, predictors and seeds, and what they say together."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import exit_codes
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.option_types import Names, whole_number
from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format
from robot_formation.errors import FormationError

if TYPE_CHECKING:
    from robot_formation.bag.bag_path import PathReservation
    from robot_formation.experiment.sweep import Plan

DESCRIPTION = """\
Run every combination of tracks, paths, surfaces, predictors and seeds in process (camera on demand; fine-tuner in mode
'paper', unless --set fine_tuner.mode=precise), and compare the predictors: medians with 95 % bootstrap intervals,
paired over seeds. The table of runs grows in OUT/runs.csv; a sweep that was stopped goes on there when the same command
is given again. Besides the predictors of 'formation list', 'ideal' and 'ideal+close' show the noise floor: the same
controller, commanded the ideal move.
"""
MOST_SEEDS = 1_000_000
_REMEDY = "the same command with this --out goes on, also without what failed"


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("sweep", help="compare predictors over many runs", description=DESCRIPTION)
    for name, default, what in (
        ("tracks", ("one", "two"), "preset tracks"),
        ("paths", ("straight",), "the leader's paths"),
        ("surfaces", ("bowl",), "surfaces"),
        ("predictors", ("previous", "measured", "formation"), "predictors"),
    ):
        told = f"{what}; may be repeated (default: {','.join(default)})"
        parser.add_argument(f"--{name}", metavar="NAME,...", action=Names, default=default, help=told)
    parser.add_argument(
        "--seeds",
        metavar="FIRST:END,...",
        action=Names,
        default=("0:20",),
        help="seeds FIRST to END - 1, or single ones: 7 is the one seed 7; may be repeated (default: 0:20)",
    )
    parser.add_argument(
        "--jobs", metavar="N", type=whole_number, default=os.cpu_count() or 1, help="runs at the same time"
    )
    parser.add_argument("--dask", metavar="SCHEDULER", help="address of a Dask scheduler, instead of --jobs")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of the results (default: a new one in bags/)")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="any parameter, for all runs; may be repeated"
    )
    add_format(parser)
    parser.add_argument("--json", action="store_true", help="print the summary as JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Sweep and print the summary; return 0, or 130 when interrupted.

    Raises:
        FormationError: on anything wrong in the arguments or the folder, before anything is run.
    """
    from robot_formation.experiment import sweep
    from robot_formation.extras import require

    plan = sweep.Plan(
        args.tracks, args.surfaces, args.predictors, seeds(",".join(args.seeds)), tuple(args.set), args.paths
    )
    if args.jobs < 1:
        raise FormationError(f"--jobs is at least 1, not {args.jobs}")
    plan.check()
    require("dask") if args.dask else require("ros", "sim")
    if args.out is not None:
        return _sweep(args, plan, args.out)
    with default_folder() as place:
        return _sweep(args, plan, place.path)


def _sweep(args: argparse.Namespace, plan: Plan, folder: Path) -> int:
    from robot_formation.analysis.sweep_summary import summarise
    from robot_formation.experiment import sweep, sweep_runs
    from robot_formation.experiment.sweep_results import (
        SUMMARY_NAME,
        announcements,
        sweep_report,
        sweep_text,
        write_results,
    )

    results = sweep.Table(folder, plan)
    for line in announcements(plan):
        print(line, file=sys.stderr)
    tasks = sweep.remaining(plan, results.rows)
    done = len(results.rows)
    if tasks:
        if done:
            print(f"{folder}: {done} runs are there already, {len(tasks)} are left", file=sys.stderr)
        rows = (
            sweep_runs.carry_out_by_dask(tasks, plan.settings, args.dask)
            if args.dask
            else sweep_runs.carry_out(tasks, plan.settings, min(args.jobs, len(tasks)))
        )
        try:
            for row in with_progress(rows, len(tasks)):
                results.add(row)
        except sweep_runs.FailedRunsError as error:
            for line in error.lines:
                print(f"formation sweep: {line}", file=sys.stderr)
            print(f"formation sweep: {len(results.rows)} runs are in {folder}; {_REMEDY}", file=sys.stderr)
            return exit_codes.BAD_INPUT
        except KeyboardInterrupt:
            print(f"\nformation sweep: interrupted; the same command with --out {folder} goes on", file=sys.stderr)
            return exit_codes.INTERRUPTED
    rows_now = sweep.chosen(plan, results.rows)
    summary = summarise(rows_now)
    picture = write_results(folder, plan, rows_now, summary, args.format)
    if args.json:
        print(json.dumps(sweep_report(plan, summary, folder, [picture]), indent=2))
    else:
        print(sweep_text(plan, summary))
        print(f"\nruns: {folder / sweep.RUNS_NAME}\nsummary: {folder / SUMMARY_NAME}\npicture: {picture}")
    return exit_codes.DONE


def seeds(text: str) -> tuple[int, ...]:
    """Read FIRST:END, single seeds, or several of these separated by commas; each seed counts once.

    Raises:
        FormationError: on anything else, or an empty range.
    """
    found = tuple(dict.fromkeys(seed for part in text.split(",") for seed in _seeds(part)))
    if len(found) > MOST_SEEDS:
        raise FormationError(f"--seeds {text} are more than a million")
    return found


def _seeds(text: str) -> range:
    match = re.fullmatch(r"(\d{1,18})(?::(\d{1,18}))?", text)
    if match is None:
        raise FormationError(f"--seeds takes FIRST:END, like 0:200, or single seeds, like 7,8, not '{text[:60]}'")
    first = int(match[1])
    end = int(match[2]) if match[2] else first + 1
    if end <= first:
        raise FormationError(f"--seeds {text} holds no seed: END is not among them")
    if end - first > MOST_SEEDS:
        raise FormationError(f"--seeds {text} are more than a million")
    return range(first, end)


def default_folder() -> PathReservation:
    """Reserve a new folder name made from the time."""
    from robot_formation.bag.bag_path import reserve_new
    from robot_formation.paths import default_bags_dir

    return reserve_new(default_bags_dir(), f"sweep_{time.strftime('%Y%m%d-%H%M%S')}")
