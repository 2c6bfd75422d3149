"""`formation score`: a predictor of your own beside those that came before."""

from __future__ import annotations

import argparse
import json
import os
import sys

from robot_formation import exit_codes
from robot_formation.batch.progress_line import with_progress
from robot_formation.cli.option_types import positive_whole
from robot_formation.cli.parser import Subparsers

DESCRIPTION = """\
Run a predictor in process on five courses, with seeds that are used for nothing else, beside 'previous', 'measured' and
'formation', and print a table. The score is by how many per cent it leaves less correction distance than 'previous',
the mean over the courses: 0 is as good as 'previous', 100 is nothing left to correct. Fewer lost runs rank first, then
the higher score. Conditions are those of 'formation sweep' (fine-tuner in mode 'paper', camera on demand).
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("score", help="a predictor of your own beside the others", description=DESCRIPTION)
    parser.add_argument(
        "predictor",
        metavar="MODULE:CLASS",
        help="class in a module that can be imported or lies in the working directory; or a predictor's name",
    )
    parser.add_argument(
        "--jobs",
        metavar="N",
        type=positive_whole,
        default=os.cpu_count() or 1,
        help="runs at the same time (default: one for each core)",
    )
    parser.add_argument("--quick", action="store_true", help="one seed for each course instead of five")
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Score and print; return 0.

    Raises:
        FormationError: there is no such predictor, or its class fails.
    """
    # Imported here, so that the other verbs don't pay for the simulation.
    from robot_formation.experiment import score

    score.check(args.predictor)
    count = len(score.runs(args.predictor, quick=args.quick))
    print(f"{len(score.predictors(args.predictor))} predictors, {count} runs", file=sys.stderr)
    rows = score.rows(args.predictor, quick=args.quick, jobs=min(args.jobs, count))
    found = score.judged(args.predictor, list(with_progress(rows, count)))
    print(json.dumps(found.to_json(), indent=2) if args.json else found)
    return exit_codes.DONE
