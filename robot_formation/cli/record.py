"""`formation record`: topics of the ROS graph into a bag."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation.cli.bag_options import MIB, add_split, split_bytes
from robot_formation.cli.messages import say, warn
from robot_formation.cli.option_types import positive
from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    from robot_formation.bag.bag_path import PathReservation
    from robot_formation.nodes.recorder.recorder_node import RecorderParameters, RecordReport

DESCRIPTION = """\
Record topics of the ROS graph (ROS_DOMAIN_ID and the like count) into an MCAP bag until Ctrl-C. Topics that appear
later are recorded too. The folder is called DIR.partial until the bag is closed; 'formation recover' completes one
whose recorder was killed.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("record", help="record topics into a bag", description=DESCRIPTION)
    parser.add_argument("topics", metavar="TOPIC", nargs="*", help="topic to record")
    parser.add_argument("-a", "--all", action="store_true", help="record all topics")
    parser.add_argument("-e", "--regex", metavar="R", default="", help="record topics that match as a whole")
    parser.add_argument(
        "-x", "--exclude", metavar="R", help="leave out topics that match as a whole (default: see docs)"
    )
    parser.add_argument("--no-images", action="store_true", help="leave pictures out, unless their topic is named")
    parser.add_argument("-o", "--out", metavar="DIR", type=Path, help="folder of the bag (default: a new one in bags/)")
    parser.add_argument("--compression", choices=("zstd", "none"), default="zstd", help="of the chunks (default: zstd)")
    parser.add_argument("--chunk-size", metavar="MIB", type=positive, default=1.0, help="of a chunk (default: 1)")
    add_split(parser)
    parser.add_argument(
        "--queue-size",
        metavar="MIB",
        type=positive,
        default=64.0,
        help="memory for what waits for the disk (default: 64)",
    )
    parser.add_argument(
        "--time",
        choices=("receive", "simulated"),
        default="receive",
        help="log times: the wall clock (default), or the messages' own stamps",
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Record until a signal; return 0.

    Raises:
        FormationError: nothing is asked for, a regular expression is none, the path is taken, or the disk is full.
    """
    if args.all == bool(args.topics or args.regex):
        raise FormationError("say what to record: topics, --regex, or --all alone")
    from robot_formation.bag.bag_path import PathReservation, check_free
    from robot_formation.bag.selection import Selection
    from robot_formation.network.loading_ros import require_ros

    require_ros()  # before it is loaded
    Selection(args.topics, args.regex, args.exclude or "")  # a bad expression is told before ROS is loaded
    with PathReservation(args.out) if args.out else default_bag() as place:
        check_free(place.path)
        report = _record(args, place.path)
    for text in _warnings(report):
        warn(text)
    count = sum(report.message_counts.values())
    if args.json:
        print(json.dumps(_to_json(report), indent=2))
    else:
        print(f"{count} messages on {len(report.message_counts)} topics in {report.path}")
    return 0


def default_bag() -> PathReservation:
    """Reserve a new bag name made from the time."""
    from robot_formation.bag.bag_path import reserve_new
    from robot_formation.paths import default_bags_dir

    return reserve_new(default_bags_dir(), time.strftime("recording_%Y%m%d-%H%M%S"))


def _record(args: argparse.Namespace, path: Path) -> RecordReport:
    from robot_formation.bag.provenance import versions
    from robot_formation.nodes.host.session import node_session
    from robot_formation.nodes.recorder.recorder_node import RecorderNode
    from robot_formation.system.git_commit import git_commit
    from robot_formation.system.signal_handling import SignalCounter

    texts = {"versions": json.dumps(versions()), "git_commit": git_commit()}
    parameters = _parameters(args, path, tuple(f"{key}={text}" for key, text in texts.items()))
    with SignalCounter(1) as signals, node_session("recorder") as node:
        recorder = RecorderNode(node, parameters, say=say, warn=warn, ask=True)
        say(f"recording into {path}; Ctrl-C ends")
        return recorder.run(signals.came)


def _parameters(args: argparse.Namespace, path: Path, metadata: tuple[str, ...]) -> RecorderParameters:
    from robot_formation.nodes.recorder.recorder_node import RecorderParameters
    from robot_formation.parameters import from_mapping

    values = {
        "path": str(path),
        "topics": args.topics,
        "regex": args.regex,
        "images": not args.no_images,
        "time": args.time,
        "compression": args.compression,
        "chunk_bytes": round(args.chunk_size * MIB),
        "split_bytes": split_bytes(args),
        "split_s": args.max_duration,
        "queue_bytes": round(args.queue_size * MIB),
        "metadata": metadata,
    }
    if args.exclude is not None:
        values["exclude"] = args.exclude
    return from_mapping(RecorderParameters, values, where="record")


def _warnings(report: RecordReport) -> list[str]:
    found = [f"nobody has published {topic}" for topic in report.unseen]
    if not sum(report.message_counts.values()):
        found.append("no message was recorded")
    for text, counts in (
        ("dropped: the disk is too slow for --queue-size", report.dropped),
        ("lost on the way", report.lost),
    ):
        found += [f"{number} messages of {topic} {text}" for topic, number in counts.items()]
    return found


def _to_json(report: RecordReport) -> JsonObject:
    return {
        "bag": str(report.path),
        "messages": sum(report.message_counts.values()),
        "topics": dict(report.message_counts),
        "dropped": dict(report.dropped),
        "lost": dict(report.lost),
        "unseen": list(report.unseen),
    }
