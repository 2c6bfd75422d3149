"""`formation recover`: a complete bag of one whose recorder was killed, or whose disk was full."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError

DESCRIPTION = """\
Copy every message of every finished chunk out of a bag that was cut off into a complete one. BAG is a .partial folder
or an .mcap file, also one of another recorder; it stays as it is.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("recover", help="complete a bag that was cut off", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag that was cut off")
    parser.add_argument(
        "-o", "--out", metavar="OUT", type=Path, help="folder of the new bag (default: beside the old one)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Recover a bag and say how much was saved; return 0.

    Raises:
        FormationError: nothing can be saved, the bag is still being written, or the new path is taken.
    """
    from robot_formation.bag.recover import is_being_written, recover

    if is_being_written(args.bag):
        raise FormationError(f"{args.bag} is still being written; end its recorder, or wait for it")
    report = recover(args.bag, args.out or default_out(args.bag))
    seconds = (report.last_stamp_ns - report.first_stamp_ns) / 1e9
    if args.json:
        found = dataclasses.asdict(report)
        print(json.dumps({**found, "path": str(report.path), "duration_s": seconds}, indent=2))
        return 0
    print(f"saved {report.messages} messages on {len(report.message_counts)} topics, {seconds:.3f} s: {report.path}")
    if report.complete and not report.damaged_chunks:
        print("nothing is missing")
    if not report.complete:
        print(f"the bag was cut off: the last {report.lost_bytes} bytes can't be read")
    if report.damaged_chunks:
        print(f"left out because they are damaged: {report.damaged_chunks} chunks")
    return 0


def default_out(bag: Path) -> Path:
    """Return the new bag's name: that of a .partial folder gets the name it was to have."""
    from robot_formation.bag.bag_path import PARTIAL_SUFFIX
    from robot_formation.bag.folder import bag_name

    bag = bag.resolve()
    name = bag_name(bag)
    return bag.with_name(name if bag.name.endswith(PARTIAL_SUFFIX) else f"{name}_recovered")
