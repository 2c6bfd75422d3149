"""`formation info`: what is in a bag."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from robot_formation.cli.parser import Subparsers

DESCRIPTION = """\
Summarise a bag, ours or one of 'ros2 bag' (MCAP or SQLite), as 'ros2 bag info' does, without ROS. A bag that was not
closed is summarised as far as it can be saved.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("info", help="what is in a bag", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag: a folder, an .mcap or a .db3 file")
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the summary; return 0.

    Raises:
        FormationError: the bag can't be read.
    """
    # Imported here, so that the other verbs don't pay for rosbags.
    from robot_formation.bag.info import bag_info, info_text

    info = bag_info(args.bag)
    print(json.dumps(info.to_mapping(), indent=2) if args.json else info_text(info))
    return 0
