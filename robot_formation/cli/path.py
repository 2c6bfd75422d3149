"""`formation path`: the way that a recorded leader was driven, as a file of waypoints."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError

DESCRIPTION = """\
Write the moves of a recorded run's leader as CSV (dx_m,dy_m,dyaw_rad, one line per timestep), to standard output or a
file. As the path 'waypoints' they are driven again to the last bit: formation run --path waypoints
--set 'leader.path_parameters=[file=driven.csv]'.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("path", help="the way a recorded leader was driven, as CSV", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag of a run: a folder, an .mcap or a .db3 file")
    parser.add_argument("--out", metavar="FILE", type=Path, help="a new file, instead of standard output")
    parser.add_argument("--namespace", help="of the formation, where the bag holds several; '/' for the root")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the moves; return 0.

    Raises:
        FormationError: the bag can't be read or has no leader, or the file is there already or can't be written.
    """
    from robot_formation.analysis.leader_moves import load_leader_moves, waypoint_text

    moves = load_leader_moves(args.bag, args.namespace)
    text = waypoint_text(moves)
    if args.out is None:
        sys.stdout.write(text)
        return 0
    try:
        with args.out.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise FormationError(f"{args.out}: can't be written: {error.strerror}; choose another --out") from None
    print(f"{args.out}: {len(moves)} timesteps")
    return 0
