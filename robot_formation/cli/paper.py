"""`formation paper`: every figure of the paper from our own calibrations and runs, beside what the paper states."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import exit_codes
from robot_formation.cli.messages import say
from robot_formation.cli.option_types import number, option_type, positive_whole
from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format

if TYPE_CHECKING:
    from robot_formation.paper.work import Results, Work

DESCRIPTION = """\
Calibrate the robots, run both tracks of the paper without prediction, with the paper's and with this project's
predictor, from the same start and from the paper's own ones, draw every figure of the paper from that, and write a page
(index.html) that sets each beside the numbers that the paper states. Takes some minutes; a call that was stopped goes
on when the same command is given again, and nothing is measured twice.
"""
PAGE_NAME = "index.html"
NUMBERS_NAME = "numbers.json"
_REPEATS = option_type(int, lambda value: 1 <= value <= 1000, "a whole number from 1 to 1000")
_SEEDS = option_type(int, lambda value: 1 <= value <= 1_000_000, "a whole number from 1 to a million")


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("paper", help="the paper's figures from our own runs", description=DESCRIPTION)
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of all files (default: bags/paper)")
    parser.add_argument(
        "--seeds", metavar="N", type=_SEEDS, default=10, help="seeds of the runs that are compared (default: 10)"
    )
    parser.add_argument(
        "--repeats",
        metavar="N",
        type=_REPEATS,
        default=10,
        help="times each of the motors' drives is made forth and back, the encoders' half as often (default: 10)",
    )
    parser.add_argument(
        "--step", metavar="M", type=number, default=0.05, help="step of the camera's grid, in metres (default: 0.05)"
    )
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="any parameter, for all runs; may be repeated"
    )
    parser.add_argument(
        "--jobs", metavar="N", type=positive_whole, default=os.cpu_count() or 1, help="processes at the same time"
    )
    add_format(parser)
    parser.add_argument("--force", action="store_true", help="remove what an earlier call measured, and start anew")
    parser.add_argument("--json", action="store_true", help="print the numbers as JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measure, draw, write the page, and print how the numbers compare; return 0, or 130 when interrupted.

    Raises:
        FormationError: on anything wrong in the arguments or the folder, or if something can't be measured.
    """
    from robot_formation.extras import require
    from robot_formation.paths import default_bags_dir

    require("ros", "sim")
    from robot_formation.paper.work import Work, carry_out_work

    folder = args.out or default_bags_dir() / "paper"
    work = Work(folder, args.seeds, args.repeats, args.step, tuple(args.set), args.jobs)
    work.open(force=args.force)
    try:
        results = carry_out_work(work, args.format, say)
        _finish(args, work, results)
    except KeyboardInterrupt:
        print(f"\nformation paper: interrupted; the same command goes on in {folder}", file=sys.stderr)
        return exit_codes.INTERRUPTED
    return exit_codes.DONE


def _finish(args: argparse.Namespace, work: Work, results: Results) -> None:
    """Draw, write page and numbers, and print."""
    from robot_formation.paper.comparison import compare
    from robot_formation.paper.index_page import write_page
    from robot_formation.paper.pictures import draw_all

    say("drawing the figures")
    pictures = draw_all(results, work, args.format)
    compared = compare(results)
    page = write_page(pictures, compared, results.rows, _facts(work), work.folder / PAGE_NAME)
    said = {
        "page": str(page),
        "pictures": {name: str(picture) for name, picture in pictures.items()},
        "figures": {name: [entry.to_json() for entry in entries] for name, entries in compared.items()},
    }
    text = json.dumps(said, indent=2, allow_nan=False)
    (work.folder / NUMBERS_NAME).write_text(text + "\n", encoding="utf-8")
    if args.json:
        print(text)
        return
    entries = [entry for found in compared.values() for entry in found]
    agreeing = sum(entry.agrees is True for entry in entries)
    print(f"{len(pictures)} figures, {len(entries)} numbers of the paper, {agreeing} agree")
    for entry in entries:
        if entry.agrees is not True:
            print(f"  {_line(entry.to_json())}")
    print(f"\npage: {page}\nnumbers: {work.folder / NUMBERS_NAME}")


def _line(entry: dict[str, object]) -> str:
    from robot_formation.paper.index_page import number_text

    paper, ours, unit = entry["paper"], entry["ours"], str(entry["unit"])
    assert isinstance(paper, (int, float))
    own = number_text(ours, unit) if isinstance(ours, (int, float)) else "unknown"
    return f"{entry['says']}: paper {number_text(paper, unit)}, ours {own}"


def _facts(work: Work) -> list[str]:
    """Describe how all was measured."""
    from robot_formation.paper.work import SEED

    settings = f" Settings: {', '.join(work.settings)}." if work.settings else ""
    return [
        f"Conditions: simulated robots, alignment mode 'paper', camera on demand, {work.seeds} seeds per track and "
        f"predictor; the figures show seed {SEED}.{settings} 'previous' is the paper's run without prediction, "
        "'measured' its Algorithm 1 with measured pairs, 'formation' this project's own predictor.",
        f"Made by: formation paper --seeds {work.seeds} --repeats {work.repeats} --step {work.step_m:g}"
        + "".join(f" --set {setting}" for setting in work.settings),
    ]
