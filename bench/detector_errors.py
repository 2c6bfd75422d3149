"""Errors of the reported edges: random rectangles of a taught colour, alone in the picture, against the truth.

A red rectangle of 12 to 70 px, at a random place with fractions of a pixel (edge pixels are mixed by coverage), on
grey, with noise of 3 levels. The signature is taught from such a picture. Beside ours stand the figures that the
camera's own code gave in an experiment of this kind, whose signature range is not known. Edges are in pixels of the
316 x 208 frame, counted from the frame's left and top edge: an exact box would be reported with left, right and top
right, and with its bottom, which is the last row itself, 1 px short.

Run: python bench/detector_errors.py [--rectangles 600] [--seed 1]
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.signatures import teach_region

RED, GREY = np.array((200.0, 40.0, 40.0)), np.array((112.0, 112.0, 112.0))
SIGMA = 3.0
RANGES = (3.5, 5.0, 8.0)
"""The camera's default, the paper's for the Target face, and one wide enough for nearly all of the noise."""
CAMERA = {
    "left": (0.8, 1.1),
    "right": (-2.1, 2.3),
    "top": (0.4, 0.3),
    "bottom": (-1.4, 0.3),
    "centre x": (-0.6, 1.3),
    "centre y": (-0.5, 0.2),
}


def coverage(low: float, high: float, count: int) -> npt.NDArray[np.float64]:
    """Share of each of `count` pixels that lies within [low, high]."""
    pixels = np.arange(count)
    share: npt.NDArray[np.float64] = np.clip(np.minimum(pixels + 1, high) - np.maximum(pixels, low), 0.0, 1.0)
    return share


def picture(rectangles: Sequence[tuple[float, float, float, float]], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Red rectangles (left, right, top, bottom) on grey, with noise."""
    image = np.broadcast_to(GREY, (208, 316, 3))
    for left, right, top, bottom in rectangles:
        share = np.outer(coverage(top, bottom, 208), coverage(left, right, 316))[..., None]
        image = image + share * (RED - image)
    return np.clip(np.rint(image + rng.normal(0.0, SIGMA, image.shape)), 0, 255).astype(np.uint8)


def rectangle(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """A random rectangle within the frame, left of its last quarter."""
    width, height = rng.uniform(12, 70, 2)
    left, top = rng.uniform(2, 230 - width), rng.uniform(2, 206 - height)
    return left, left + width, top, top + height


def errors(
    detector: BlockDetector, truth: tuple[float, float, float, float], image: npt.NDArray[np.uint8]
) -> npt.NDArray[np.float64] | None:
    """Reported minus true left, right, top, bottom and centre of the leftmost block, or None if there is none."""
    boxes = sorted(detector.detect(image), key=lambda box: box.left)
    if not boxes:
        return None
    box = boxes[0]
    left, right, top, bottom = truth
    found = (box.left, box.right, box.top, box.bottom, box.x, box.y)
    return np.subtract(found, (left, right, top, bottom, (left + right) / 2, (top + bottom) / 2))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rectangles", type=int, default=600, help="how many (default: 600)")
    parser.add_argument("--seed", type=int, default=1, help="seed of places, sizes and noise (default: 1)")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    taught = teach_region(picture([(100, 200, 50, 150)], rng), (110, 60, 80, 80), 1)
    truths = [rectangle(rng) for _ in range(args.rectangles)]
    alone = [picture([truth], rng) for truth in truths]
    # With a bar over the whole height further right, no row has the rectangle as its last segment.
    beside = [picture([truth, (260, 290, 0, 208)], rng) for truth in truths]
    columns, shifts = [], []
    for gain in RANGES:
        detector = BlockDetector([taught], DetectorParameters(signature_range=(gain,)))
        found, moved = (
            [errors(detector, truth, image) for truth, image in zip(truths, images, strict=True)]
            for images in (alone, beside)
        )
        both = [(a, b) for a, b in zip(found, moved, strict=True) if a is not None and b is not None]
        columns.append(np.array([a for a, _ in both]))
        shifts.append(np.mean([b[0] - a[0] for a, b in both]))
    print(f"{args.rectangles} rectangles, errors in px: mean and standard deviation by signature range")
    print(f"{'':9}" + "".join(f"{gain:>14}" for gain in RANGES) + f"{'camera':>14}")
    for number, (name, camera) in enumerate(CAMERA.items()):
        pairs = [(column[:, number].mean(), column[:, number].std()) for column in columns]
        print(f"{name:9}" + "".join(f"  {mean:+5.1f} +- {scatter:3.1f}" for mean, scatter in [*pairs, camera]))
    print(f"{'found':9}" + "".join(f"{len(column):14d}" for column in columns))
    print(f"{'shift':9}" + "".join(f"{shift:+14.1f}" for shift in shifts) + f"{'+2':>14}")
    print("shift: of the left edge, where another block lies further right in the same rows")
    return 0


if __name__ == "__main__":
    sys.exit(main())
