"""Options of the verbs that write bags: into how many files."""

from __future__ import annotations

import argparse

from robot_formation.cli.option_types import positive

MIB = 1 << 20


def add_split(parser: argparse.ArgumentParser) -> None:
    """Add the options that split a bag."""
    parser.add_argument(
        "--max-size", metavar="MIB", type=positive, default=0.0, help="begin a new file of the bag after so much"
    )
    parser.add_argument(
        "--max-duration",
        metavar="S",
        type=positive,
        default=0.0,
        help="begin a new file of the bag after so many seconds of its log times",
    )


def split_bytes(args: argparse.Namespace) -> int:
    """Return the size after which a new file is begun; 0: never."""
    size_mib: float = args.max_size
    return round(size_mib * MIB)


def split_ns(args: argparse.Namespace) -> int:
    """Return the duration after which a new file is begun, nanoseconds; 0: never."""
    duration_s: float = args.max_duration
    return round(duration_s * 1e9)
