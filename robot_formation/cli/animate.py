"""`formation animate`: a recorded run as an animation."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from robot_formation import names
from robot_formation.cli.messages import warn
from robot_formation.cli.option_types import option_type
from robot_formation.cli.parser import Subparsers

DESCRIPTION = """\
Draw a recorded run: from above over the ground's contour lines (robots with their markers, ways, place in formation,
forecast with its 90 % ellipse), the follower's camera with the blocks that were found, how far the follower is from its
place, and the corrections and formation error of each timestep. FILE ends with .gif, .mp4 (needs the program ffmpeg) or
.png (one picture, of the end). A bag without camera pictures has them rendered from ground truth, and the picture says
so.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("animate", help="a run's bag as GIF or film", description=DESCRIPTION)
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag of the run")
    parser.add_argument(
        "--out",
        metavar="FILE",
        type=Path,
        help="file to write; an older one is replaced (default: animation.gif in <BAG>_analysis)",
    )
    parser.add_argument("--follower", metavar="NAME", help=f"whose camera is shown (default: {names.follower(1)})")
    parser.add_argument(
        "--fps",
        metavar="N",
        type=option_type(float, lambda value: 0.1 <= value <= 50.0, "a number from 0.1 to 50"),
        default=10.0,
        help="pictures per second (default: 10)",
    )
    parser.add_argument(
        "--every",
        metavar="S",
        type=option_type(float, lambda value: 0.01 <= value < 1e6, "a number of seconds from 0.01 on"),
        help="simulated seconds from one picture to the next (default: as many as make about 150 pictures)",
    )
    parser.add_argument(
        "--size",
        metavar="PIXELS",
        type=option_type(int, lambda value: 320 <= value <= 2400, "a whole number of pixels from 320 to 2400"),
        default=800,
        help="width of the pictures; the height goes with it (default: 800)",
    )
    parser.add_argument(
        "--namespace", metavar="NS", help="the formation's namespace, where the bag holds several formations"
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Make an animation; return 0.

    Raises:
        FormationError: the bag can't be read or has no run with ground truth, or the file can't be written.
    """
    # Imported here, so that the other verbs don't pay for matplotlib and rosbags.
    import json

    from robot_formation.batch.progress_line import with_progress
    from robot_formation.system.files import size_text
    from robot_formation.viewing.animate import animate

    made = animate(
        args.bag,
        args.out,
        args.follower or names.follower(1),
        namespace=args.namespace,
        fps=args.fps,
        every_s=args.every,
        width_px=args.size,
        progress=partial(with_progress, what="pictures"),
    )
    if made.rendered and not made.known_world:
        warn(f"{args.bag} doesn't tell the world's parameters: the camera's pictures are rendered by the defaults")
    size_bytes, (width, height) = made.path.stat().st_size, made.size
    if args.json:
        said = {
            "file": str(made.path),
            "pictures": made.pictures,
            "width_px": width,
            "height_px": height,
            "fps": args.fps,
        }
        print(json.dumps({**said, "every_s": made.every_s, "rendered": made.rendered, "size_bytes": size_bytes}))
    else:
        pictures = f"{made.pictures} picture{'' if made.pictures == 1 else 's'}"
        print(f"{made.path}: {pictures} of {width} x {height} pixels, {size_text(size_bytes)}")
    return 0
