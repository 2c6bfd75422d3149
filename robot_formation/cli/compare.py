"""`formation compare`: runs side by side, from their bags, without ROS."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format

DESCRIPTION = """\
Set runs side by side: totals in a table, corrections, errors and trajectories in pictures, and in what the runs' own
descriptions (scenario, parameters, versions) differ. BAG is what 'formation analyze' takes. Rows 'along u' are to the
right, 'along v' forward.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("compare", help="runs side by side", description=DESCRIPTION)
    parser.add_argument("bags", metavar="BAG", type=Path, nargs="+", help="two or more bags to compare")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="folder for the pictures (default: <first BAG>_comparison)"
    )
    parser.add_argument(
        "--json", action="store_true", help="print JSON and nothing else; pictures are drawn only if --out is given"
    )
    add_format(parser)
    parser.add_argument("--no-pictures", action="store_true", help="draw no pictures")
    parser.add_argument(
        "--namespace", metavar="NS", help="the formations' namespace, where bags hold several formations"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Compare runs; return 0, also for runs that lost their leader.

    Raises:
        FormationError: fewer than two bags, a bag given twice, one that can't be read or has no run, or pictures that
            can't be written.
    """
    # Imported here, so that the other verbs don't pay for rosbags.
    import json

    from robot_formation.reporting.comparison_table import comparison_json, comparison_text
    from robot_formation.reporting.runs import ReportError, load_runs

    if len(args.bags) < 2:
        raise ReportError(f"one bag, {args.bags[0]}, has nothing to be compared with; give two or more")
    runs = load_runs(args.bags, args.namespace)
    if not args.json:
        print(comparison_text(runs))
    drawn = not args.no_pictures and not (args.json and args.out is None)
    pictures: list[Path] = []
    if drawn:
        from robot_formation.reporting.comparison_figures import comparison_folder, write_comparison

        pictures = write_comparison(runs, args.out or comparison_folder(args.bags[0]), args.format)
    if args.json:
        found = {**comparison_json(runs), "pictures": [str(picture) for picture in pictures]}
        print(json.dumps(found, indent=2, allow_nan=False))
    elif pictures:
        print("\npictures: " + ", ".join(str(picture) for picture in pictures))
    return 0
