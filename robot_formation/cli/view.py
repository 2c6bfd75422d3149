"""`formation view`: a recorded run in three dimensions in a browser, or as a page in a file."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot_formation import exit_codes
from robot_formation.cli.messages import say, warn
from robot_formation.cli.option_types import port
from robot_formation.cli.parser import Subparsers

DESCRIPTION = """\
Show a run's bag in a browser of this machine: ground, robots, what the follower's camera saw, its place in formation
and its forecast, with pause, steps, speed and time. Ctrl-C ends it. With --html it writes a page instead that needs
neither this program nor a network.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("view", help="a run's bag in 3-D in a browser", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag of a run: a folder, an .mcap or a .db3 file")
    parser.add_argument(
        "--html",
        metavar="FILE",
        type=Path,
        help="write one self-contained page there and end; an older one is replaced",
    )
    parser.add_argument("--port", metavar="N", type=port, help="port on 127.0.0.1 (default: 8080; 0: any free one)")
    parser.add_argument(
        "--namespace", metavar="NS", help="the formation's namespace, where the bag holds several formations"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Show or write the view; return 0, also when Ctrl-C ends it.

    Raises:
        FormationError: the bag can't be read or has no run or true poses, viser is missing, the port is taken, or the
            page can't be written.
    """
    from robot_formation.bag.formation_bag import FormationBag
    from robot_formation.bag.reader import read_bag
    from robot_formation.viewing.browser import DEFAULT_PORT, address, check_viewer, open_browser, view_server

    wanted = DEFAULT_PORT if args.port is None else args.port
    serving = check_viewer(0 if args.html else wanted)
    with read_bag(args.bag) as opened:
        from robot_formation.viewing.run_moments import RunMoments

        bag = FormationBag(opened, args.namespace)
        moments = RunMoments(bag)
        if args.html:
            from robot_formation.viewing.view_page import write_page

            size = write_page(args.html, bag, moments, warn)
            say(f"{args.html}: {size / 1e6:.1f} MB")
            return exit_codes.DONE
        from robot_formation.system.signal_handling import SignalCounter
        from robot_formation.viewing.show_bag import BagShow

        with SignalCounter(1) as signals, view_server(serving, moments.title) as server:
            show = BagShow(server, bag, moments, warn)
            say(open_browser(address(server.get_port())))
            say("Ctrl-C ends the view")
            show.run(signals.came)
    return exit_codes.DONE
