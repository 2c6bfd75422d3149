"""`formation detect`: the blocks that a Pixy2 reports of images."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from robot_formation.cli.messages import say
from robot_formation.cli.option_types import positive_whole, quoted
from robot_formation.cli.parser import Subparsers
from robot_formation.errors import FormationError
from robot_formation.json_values import JsonObject

if TYPE_CHECKING:
    from robot_formation.vision.pixy2.block import Block
    from robot_formation.vision.pixy2.parameters import DetectorParameters
    from robot_formation.vision.pixy2.picture import Picture
    from robot_formation.vision.sensors import BlockSensor

DESCRIPTION = """\
Find the blocks of taught colours in images, as a Pixy2 does, or, with --sensor tags, the faces of a marker of tags.
Each image is taken by itself (shown twice, with block filtering 0), or, with --sequence, as the next frame of one
sequence, with tracking.
"""
_FRAME_US = 16_200
_DEFAULT_SENSOR = "colours"


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("detect", help="find blocks of taught colours in images", description=DESCRIPTION)
    parser.add_argument(
        "images", metavar="IMAGE", type=Path, nargs="+", help="image file, 316 x 208 (others are scaled)"
    )
    parser.add_argument(
        "--sensor",
        metavar="NAME",
        type=_sensor,
        default=_DEFAULT_SENSOR,
        help=f"{_DEFAULT_SENSOR} (default), tags, or see 'formation list sensors'",
    )
    parser.add_argument(
        "--signatures", metavar="FILE", type=Path, help="taught signatures, YAML or JSON; needed for colours"
    )
    parser.add_argument(
        "--parameters", metavar="FILE", type=Path, help="parameters by our names or PixyMon's, YAML or JSON"
    )
    parser.add_argument("--sequence", action="store_true", help="the images are successive frames")
    parser.add_argument(
        "--dt-us",
        metavar="N",
        type=positive_whole,
        default=_FRAME_US,
        help=f"with --sequence: microseconds between frames (default: {_FRAME_US})",
    )
    parser.add_argument("--draw", metavar="DIR", type=Path, help="write the images with their blocks into this folder")
    parser.add_argument(
        "--mask", metavar="FILE", type=Path, help="draw which pixels match which signature, of one image"
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Detect blocks in the images, in the order given, and print them.

    Raises:
        FormationError: an image, the signatures or the parameters can't be read, or a drawing can't be written.
    """
    # Imported here, so that the other verbs don't pay for OpenCV.
    import dataclasses
    import json

    from robot_formation.vision.pixy2.parameters import DetectorParameters
    from robot_formation.vision.pixy2.picture_files import check_readable, read_parameters, read_picture

    for path in args.images:
        check_readable(path)
    if args.mask is not None:
        _check_mask(args)
    parameters = read_parameters(args.parameters, say) if args.parameters else DetectorParameters()
    if not args.sequence:
        parameters = dataclasses.replace(parameters, block_filtering=0)
    detector = _detector(args.sensor, args.signatures, parameters)
    pictures = ((path, read_picture(path, say)) for path in args.images)
    frames = _sequence(detector, pictures, args.dt_us) if args.sequence else _singles(detector, pictures)
    results = []
    for path, picture, blocks in frames:
        results.append({"image": str(path), "blocks": [dataclasses.asdict(block) for block in blocks]})
        if args.mask is not None:
            _mask(args, parameters, picture)
        if args.draw:
            _draw(args.draw, len(results), path, picture, blocks)
    print(json.dumps(results) if args.json else _table(results))
    return 0


def _sensor(name: str) -> str:
    """Take the name of a sensor; its class is not imported for it."""
    if name == _DEFAULT_SENSOR:  # nothing has to be imported for it
        return name
    from robot_formation.parameters import suggestion
    from robot_formation.vision.sensors import SENSORS, is_outside_sensor

    if name in SENSORS or is_outside_sensor(name):
        return name
    raise argparse.ArgumentTypeError(f"can't be {quoted(name)}{suggestion(name, SENSORS)}")


def _detector(sensor: str, signatures: Path | None, parameters: DetectorParameters) -> BlockSensor:
    from robot_formation.vision.aruco_detector import TagDetector
    from robot_formation.vision.pixy2.detector import BlockDetector
    from robot_formation.vision.pixy2.signatures import load_signatures
    from robot_formation.vision.sensors import is_outside_sensor, outside_sensor

    if is_outside_sensor(sensor):
        return outside_sensor(sensor, parameters)
    if sensor == "tags":
        return TagDetector(tracking=parameters)
    if signatures is None:
        raise FormationError("colours need --signatures FILE with what 'formation teach' has taught, or --sensor tags")
    return BlockDetector(load_signatures(signatures), parameters)


Frame = tuple[Path, "Picture", "list[Block]"]


def _singles(detector: BlockSensor, pictures: Iterable[tuple[Path, Picture]]) -> Iterator[Frame]:
    """Each picture by itself: the tracker reports a box from its second frame on."""
    for path, picture in pictures:
        detector.reset()
        detector.process(picture, 0)
        yield path, picture, detector.process(picture, _FRAME_US)


def _sequence(detector: BlockSensor, pictures: Iterable[tuple[Path, Picture]], dt_us: int) -> Iterator[Frame]:
    for number, (path, picture) in enumerate(pictures):
        yield path, picture, detector.process(picture, number * dt_us)


def _draw(folder: Path, number: int, path: Path, picture: Picture, blocks: list[Block]) -> None:
    from robot_formation.vision.pixy2.block_drawing import write_drawn
    from robot_formation.vision.pixy2.picture import PictureError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PictureError(f"{folder}: can't be made ({error.strerror}); choose another folder") from error
    write_drawn(folder / f"{number:04d}_{path.stem}.png", picture, blocks)


def _check_mask(args: argparse.Namespace) -> None:
    if args.sensor != "colours":
        raise FormationError("--mask shows what colours match; leave it out, or --sensor tags")
    if len(args.images) != 1:
        raise FormationError(f"--mask takes one image, not {len(args.images)}; give the images one by one")
    if args.mask.suffix.lower() != ".png":
        raise FormationError(f"--mask writes a PNG file; end the name '{args.mask}' with .png")


def _mask(args: argparse.Namespace, parameters: DetectorParameters, picture: Picture) -> None:
    from robot_formation.vision.pixy2.block_drawing import write_mask
    from robot_formation.vision.pixy2.color_table import ColorTable
    from robot_formation.vision.pixy2.matches import matching_signatures
    from robot_formation.vision.pixy2.signatures import load_signatures

    table = ColorTable.of(load_signatures(args.signatures), parameters)
    write_mask(args.mask, picture, matching_signatures(picture, table))


def _table(results: list[JsonObject]) -> str:
    """One line per image and one per block."""
    lines = []
    for result in results:
        count = len(result["blocks"])
        lines.append(f"{result['image']}: {count or 'no'} block{'' if count == 1 else 's'}")
        lines += ["  " + "  ".join(f"{name} {value}" for name, value in block.items()) for block in result["blocks"]]
    return "\n".join(lines)
