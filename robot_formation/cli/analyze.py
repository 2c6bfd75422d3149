"""`formation analyze`: a run's table, totals and pictures from its bag, without ROS."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot_formation.cli.parser import Subparsers
from robot_formation.cli.picture_format import add_format

DESCRIPTION = """\
Print a run's timesteps and totals and draw its pictures: trajectory, corrections, formation_error (over time) and
eigenvalues (of K). BAG is a bag's folder, a single .mcap file, or the .partial folder of a run that was killed. Lengths
are along u (to the right) and v (forward).
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("analyze", help="table, totals and pictures of a run's bag", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag to analyse")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder for the pictures (default: <BAG>_analysis)")
    parser.add_argument(
        "--json", action="store_true", help="print JSON and nothing else; pictures are drawn only if --out is given"
    )
    parser.add_argument(
        "--overhead", action="store_true", help="mark in the trajectory where the overhead camera saw the robots' dots"
    )
    add_format(parser)
    parser.add_argument("--no-pictures", action="store_true", help="draw no pictures")
    parser.add_argument(
        "--namespace", metavar="NS", help="the formation's namespace, where the bag holds several formations"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Analyse a bag; return 0, also for a run that lost its leader.

    Raises:
        FormationError: the bag can't be read or has no run, or the pictures can't be written.
    """
    # Imported here, so that the other verbs don't pay for rosbags.
    from robot_formation.analysis.from_bag import load_run
    from robot_formation.analysis.quantities import analyse
    from robot_formation.analysis.report import pictures_folder, run_report, text_report, to_json, write_pictures

    record = load_run(args.bag, args.namespace)
    analysis = analyse(record)
    if not args.json:
        print(text_report(record, analysis))
    drawn = not args.no_pictures and not (args.json and args.out is None)
    pictures = []
    if drawn:
        folder = args.out or pictures_folder(args.bag)
        pictures = write_pictures(record, analysis, folder, args.format, overhead=args.overhead)
    if args.json:
        print(to_json(run_report(record, analysis, bag=args.bag, pictures=pictures)))
    elif pictures:
        print("\npictures: " + ", ".join(str(picture) for picture in pictures))
    return 0
