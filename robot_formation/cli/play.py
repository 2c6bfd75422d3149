"""`formation play`: the messages of a bag on their topics again."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation import exit_codes
from robot_formation.cli.messages import say, warn
from robot_formation.cli.option_types import number
from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    from robot_formation.nodes.player.player_node import PlayerParameters, PlayReport

DESCRIPTION = """\
Publish the messages of a bag (ours, or one of 'ros2 bag', MCAP or SQLite) when they are due, with the quality of
service that they were recorded with. On a terminal: space pauses and goes on, right arrow or s sends one message in a
pause, q ends.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("play", help="publish the messages of a bag", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag to play: a folder, an .mcap or a .db3 file")
    parser.add_argument("-r", "--rate", metavar="X", type=number, default=1.0, help="times real time (default: 1)")
    parser.add_argument("--start", metavar="S", type=number, default=0.0, help="seconds of the bag to leave out first")
    parser.add_argument("--duration", metavar="S", type=number, default=0.0, help="seconds of the bag to play")
    parser.add_argument("-l", "--loop", action="store_true", help="begin again at the end, until Ctrl-C")
    parser.add_argument("--topics", metavar="TOPIC", nargs="+", default=[], help="play these topics only")
    parser.add_argument("-e", "--regex", metavar="R", default="", help="play topics that match as a whole")
    parser.add_argument("-x", "--exclude", metavar="R", default="", help="leave out topics that match as a whole")
    parser.add_argument(
        "-m", "--remap", metavar="FROM:=TO", nargs="+", default=[], help="publish under other topic names"
    )
    parser.add_argument(
        "--clock",
        metavar="HZ",
        type=number,
        nargs="?",
        const=40.0,
        default=0.0,
        help="publish /clock (default: 40 Hz)",
    )
    parser.add_argument(
        "--wait", metavar="S", type=number, help="wait at most so long for a subscriber to every topic (default: 2)"
    )
    parser.add_argument("--pause", action="store_true", help="begin in a pause")
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Play, then print how well the schedule was kept; return 0, or 130 if interrupted.

    Raises:
        FormationError: the bag can't be read, has no such topics or no messages, or an option is out of range.
    """
    if args.rate <= 0.0:
        raise FormationError(f"--rate is {args.rate:g}, but must be above 0: 2 plays twice as fast, 0.5 at half speed")
    from robot_formation.bag.reader import read_bag
    from robot_formation.bag.selection import Selection
    from robot_formation.network.loading_ros import require_ros

    require_ros()  # before it is loaded
    selection = Selection(args.topics, args.regex, args.exclude)
    with read_bag(args.bag) as bag:
        if bag.recovered:
            say(f"{args.bag} was not closed: what can be saved of it is played")
        selection.check(bag.topics, args.bag)
        from robot_formation.nodes.host.session import node_session
        from robot_formation.nodes.player.player_node import PlayerNode
        from robot_formation.system.signal_handling import SignalCounter

        parameters = _parameters(args)
        with SignalCounter(1) as signals, node_session("player") as node:
            player = PlayerNode(node, bag, parameters, warn=warn)
            say(f"playing {args.bag}: {bag.message_count} messages, {bag.duration_s:.3f} s")
            report = player.run(signals.came)
    _tell(args, report)
    if report.interrupted:
        say("formation play: interrupted")
        return exit_codes.INTERRUPTED
    return exit_codes.DONE


def _parameters(args: argparse.Namespace) -> PlayerParameters:
    from robot_formation.nodes.player.player_node import PlayerParameters
    from robot_formation.parameters import from_mapping

    values = {
        "bag": str(args.bag),
        "rate": args.rate,
        "start_s": args.start,
        "duration_s": args.duration,
        "loop": args.loop,
        "topics": args.topics,
        "regex": args.regex,
        "exclude": args.exclude,
        "remap": args.remap,
        "clock_hz": args.clock,
        "paused": args.pause,
    }
    if args.wait is not None:
        values["wait_s"] = args.wait
    return from_mapping(PlayerParameters, values, where="play")


def _tell(args: argparse.Namespace, report: PlayReport) -> None:
    if args.wait and report.unheard:
        say(f"warning: after {args.wait:g} s nobody had subscribed to {', '.join(report.unheard)}")
    if args.json:
        print(json.dumps(_to_json(args, report), indent=2))
        return
    print(f"{sum(report.messages.values())} messages in {report.seconds:.3f} s")
    if report.schedule is not None:
        late = report.schedule
        print(
            f"schedule error: median {late['median_ms']:.3f} ms, 99 % {late['p99_ms']:.3f} ms, "
            f"worst {late['worst_ms']:.3f} ms"
        )


def _to_json(args: argparse.Namespace, report: PlayReport) -> JsonObject:
    return {
        "bag": str(args.bag),
        "messages": sum(report.messages.values()),
        "topics": dict(report.messages),
        "rounds": report.rounds,
        "seconds": report.seconds,
        "rate": args.rate,
        "schedule_error": report.schedule,
        "skipped": dict(report.skipped),
        "unheard": list(report.unheard),
        "interrupted": report.interrupted,
    }
