"""Milliseconds per 316 x 208 picture: the block detector against the usual OpenCV pipeline, in the same run.

The usual pipeline is cvtColor to HSV, inRange per signature (twice for a red one, whose hue wraps) and
connectedComponentsWithStats per mask; it does less (no row scanner, no merging, no nesting), but it is what people
write. "with tracking" is the whole step from picture to reported blocks, for which the usual pipeline has no match.
Each figure is the median over interleaved rounds of the fastest call in a round. The detector runs on one thread;
OpenCV uses as many as it likes, so that its figures depend on what else the machine does.

Run: python bench/detector.py [--rounds N] [--threads N]
"""

import argparse
import colorsys
import itertools
import json
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from cv2.typing import MatLike

from comparison import Comparison, add_comparisons, as_json
from fastest import fastest_ms
from robot_formation.parameters import from_mapping
from robot_formation.vision.pixy2.color_table import ColorTable
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import Signature

DATA = Path(__file__).parent.parent / "test" / "data" / "pixy2"
SCENES = {
    "marker 46 px": ("seqA_20.webp", "G1"),
    "marker near": ("seqA_47.webp", "G1"),
    "fills the frame": ("G5_00_frontal_near.webp", "G5"),
    "split faces": ("G3_17_split_h.webp", "G3"),
    "two markers": ("G3_22_two_markers.webp", "G3"),
    "distractors": ("G1_19_distractors.webp", "G1"),
    "specks": ("G4_21_specks.webp", "G4"),
    "18 blobs": ("G5_20_many_blobs.webp", "G5"),
    "no marker": ("G1_24_no_marker_sky.webp", "G1"),
    "99 squares": (None, "G1"),
    "coloured noise": (None, "G1"),
}
CALLS = 20
FRAME_US = 16_200


def hsv_ranges(signatures: Sequence[Signature]) -> list[list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]]:
    """Usual HSV limits (hue +-10 of 180, saturation and value from 80) around the taught colours, a list for each."""
    ranges = []
    for signature in signatures:
        red, green, blue = (signature.rgb >> shift & 255 for shift in (16, 8, 0))
        hue = round(colorsys.rgb_to_hsv(red / 255, green / 255, blue / 255)[0] * 180)
        spans = [(max(hue - 10, 0), min(hue + 10, 179))]
        if hue < 10:
            spans.append((hue + 170, 179))
        elif hue > 169:
            spans.append((0, hue - 170))
        ranges.append([(np.array((low, 80, 80)), np.array((high, 255, 255))) for low, high in spans])
    return ranges


def usual_pipeline(
    image: npt.NDArray[np.uint8], ranges: Sequence[Sequence[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]]
) -> list[MatLike]:
    """Boxes (x, y, width, height, area) of the components of each colour's mask of at least 40 pixels."""
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    found = []
    for spans in ranges:
        mask = cv2.inRange(hsv, *spans[0]).astype(np.uint8, copy=False)
        for span in spans[1:]:
            mask |= cv2.inRange(hsv, *span).astype(np.uint8, copy=False)
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask)
        found.append(stats[1:][stats[1:, cv2.CC_STAT_AREA] >= 40])
    return found


def scene_picture(scene: str) -> npt.NDArray[np.uint8]:
    """The picture of a scene: an example, a grid of squares of the taught colours, or nothing but noise."""
    name, _ = SCENES[scene]
    if name:
        stored = cv2.imread(str(DATA / name))
        assert stored is not None
        image = cv2.cvtColor(stored, cv2.COLOR_BGR2RGB).astype(np.uint8)
        return np.ascontiguousarray(np.repeat(image, 316 // image.shape[1], axis=1))
    rng = np.random.default_rng(1)
    if scene == "coloured noise":
        return rng.integers(0, 256, (208, 316, 3), np.uint8)
    image = np.full((208, 316, 3), 112.0)
    for number in range(99):
        x, y = 8 + 28 * (number % 11), 5 + 22 * (number // 11)
        image[y : y + 12, x : x + 16] = ((196, 43, 43), (43, 161, 61), (43, 75, 201))[number % 3]
    drawn: npt.NDArray[np.uint8] = np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)
    return drawn


def measure(
    detector: BlockDetector,
    image: npt.NDArray[np.uint8],
    ranges: Sequence[Sequence[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]],
    rounds: int,
) -> list[float]:
    """Milliseconds of detection, detection with tracking, and the usual pipeline."""
    clock = itertools.count(FRAME_US, FRAME_US)
    calls = (
        lambda: detector.detect(image),
        lambda: detector.process(image, next(clock)),
        lambda: usual_pipeline(image, ranges),
    )
    times = [[fastest_ms(call, CALLS) for call in calls] for _ in range(rounds)]
    return [statistics.median(column) for column in zip(*times, strict=True)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds per scene (default: 15)")
    parser.add_argument("--threads", type=int, help="threads of OpenCV (default: its own choice)")
    add_comparisons(parser)
    args = parser.parse_args()
    if args.threads is not None:
        cv2.setNumThreads(args.threads)
    examples = json.loads((DATA / "examples.json").read_text(encoding="utf-8"))
    parameters = from_mapping(DetectorParameters, examples["parameters"]["paper"], where="paper")
    if not args.comparisons:
        print(f"OpenCV {cv2.__version__} with {cv2.getNumThreads()} threads")
        print(f"{'scene':16} {'blocks':>6} {'detector ms':>12} {'with tracking':>14} {'usual ms':>9} {'ratio':>6}")
    ratios, found = [], []
    for scene, (_, group) in SCENES.items():
        signatures = [Signature.from_mapping(s, where=group) for s in examples["groups"][group]["signatures"]]
        detector = BlockDetector(signatures, parameters)
        image = scene_picture(scene)
        mine, tracked, usual = measure(detector, image, hsv_ranges(signatures), max(1, args.rounds))
        ratios.append(usual / mine)
        found.append(Comparison(f"picture: {scene}", mine, usual, "ms", "the usual OpenCV pipeline"))
        if args.comparisons:
            continue
        blocks = len(detector.detect(image))
        print(f"{scene:16} {blocks:6} {mine:12.3f} {tracked:14.3f} {usual:9.3f} {ratios[-1]:6.1f}")
    if args.comparisons:
        print(as_json(found))
        return 0
    print(f"median ratio {statistics.median(ratios):.1f}, smallest {min(ratios):.1f}")
    table = fastest_ms(lambda: ColorTable.built(signatures, parameters), CALLS)
    print(f"colour table, once per change: {table:.1f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
