"""`formation teach`: teach a colour signature from an image, as PixyMon or the camera's button does."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot_formation.cli.messages import say, warn
from robot_formation.cli.option_types import whole_number, whole_numbers
from robot_formation.cli.parser import Subparsers

DESCRIPTION = """\
Teach a colour signature from an image: from a rectangle, as "Set signature" does in PixyMon, or growing from a point,
as the camera's button does from the picture's centre (158,104). Pixels of the 316 x 208 picture. With --out, an
existing file keeps its other signatures. A signature that is grey, too narrow or too wide, overlaps another one of that
file or matches most of the picture is warned of; 'formation detect --mask FILE' shows which pixels match.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("teach", help="teach a colour signature from an image", description=DESCRIPTION)
    parser.add_argument("image", metavar="IMAGE", type=Path, help="image file, 316 x 208 (others are scaled)")
    place = parser.add_mutually_exclusive_group(required=True)
    place.add_argument("--region", metavar="X,Y,W,H", type=whole_numbers(4), help="rectangle to teach")
    place.add_argument("--point", metavar="X,Y", type=whole_numbers(2), help="point to grow from")
    parser.add_argument(
        "--signature",
        metavar="N",
        type=whole_number,
        choices=range(1, 8),
        default=1,
        help="number, 1 to 7 (default: 1)",
    )
    parser.add_argument(
        "--parameters", metavar="FILE", type=Path, help="parameters by our names or PixyMon's, YAML or JSON"
    )
    parser.add_argument("--out", metavar="FILE", type=Path, help="file of signatures to write into, YAML or .json")
    parser.add_argument("--json", action="store_true", help="print the taught signature as JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Teach, print and store a signature.

    Raises:
        FormationError: the image, the place, the parameters or the file of signatures can't be used.
    """
    # Imported here, so that the other verbs don't pay for OpenCV.
    import dataclasses
    import json

    from robot_formation.vision.pixy2.parameters import DetectorParameters
    from robot_formation.vision.pixy2.picture_files import read_parameters, read_picture
    from robot_formation.vision.pixy2.signature_quality import shortcomings
    from robot_formation.vision.pixy2.signatures import load_signatures, save_signatures, teach_point, teach_region

    parameters = read_parameters(args.parameters, say) if args.parameters else DetectorParameters()
    kept = load_signatures(args.out) if args.out and args.out.exists() else []
    picture = read_picture(args.image, say)
    if args.region:
        signature = teach_region(picture, args.region, args.signature)
    else:
        signature, _ = teach_point(picture, args.point, parameters.signature_teach_threshold, args.signature)
    found = shortcomings(signature, kept, picture, parameters)
    for shortcoming in found:
        warn(f"signature {signature.sig}: {shortcoming.text}")
    if args.out:
        save_signatures(args.out, [*(other for other in kept if other.sig != signature.sig), signature])
    if args.json:
        warnings = [dataclasses.asdict(shortcoming) for shortcoming in found]
        print(json.dumps({"signatures": [signature.to_mapping()], "warnings": warnings}))
        return 0
    print(
        f"signature {signature.sig}: u {signature.u_min} to {signature.u_max}, v {signature.v_min} to "
        f"{signature.v_max} (1/32768), colour #{signature.rgb:06x}" + (f" -> {args.out}" if args.out else "")
    )
    return 0
