"""Pictures, signatures and worked examples for the tests of the block detector."""

import functools
import json
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from repository import ROOT
from robot_formation.parameters import from_mapping
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import checked
from robot_formation.vision.pixy2.signatures import Signature

DATA = ROOT / "test" / "data" / "pixy2"
EXAMPLES = json.loads((DATA / "examples.json").read_text(encoding="utf-8"))
PARAMETERS = {
    name: from_mapping(DetectorParameters, values, where=name) for name, values in EXAMPLES["parameters"].items()
}
GROUPS = {
    name: [Signature.from_mapping(values, where=name) for values in group["signatures"]]
    for name, group in EXAMPLES["groups"].items()
}
RED, GREEN, BLUE = (196, 43, 43), (43, 161, 61), (43, 75, 201)
"""Colours that the signatures 1, 2 and 3 of group G1 were taught from."""


def stored_picture(file: Path) -> npt.NDArray[np.uint8]:
    """A picture file's BGR pixels."""
    stored = cv2.imread(str(file))
    assert stored is not None, file
    return stored.astype(np.uint8, copy=False)


@functools.cache
def picture(name: str) -> npt.NDArray[np.uint8]:
    """A picture of the examples at full width; columns that are not kept repeat their left neighbour."""
    image = stored_picture(DATA / name)[:, :, ::-1]
    return np.repeat(image, 316 // image.shape[1], axis=1)


def canvas(
    *rectangles: tuple[tuple[int, int, int, int], tuple[int, int, int]],
    background: tuple[int, int, int] = (110, 112, 115),
) -> npt.NDArray[np.uint8]:
    """A picture with rectangles ((left, top, width, height), colour)."""
    image = np.empty((208, 316, 3), np.uint8)
    image[:] = background
    for (x, y, width, height), color in rectangles:
        image[y : y + height, x : x + width] = color
    return image


def random_picture(rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Blobs of the colours of group G1, shaded, overlapping and holed, on noise, sometimes with coloured specks."""
    image = np.empty((208, 316, 3))
    image[:] = rng.integers(0, 256, 3) if rng.random() < 0.3 else rng.integers(30, 220)
    for _ in range(rng.integers(0, 40)):
        x, y = rng.integers(-20, 316), rng.integers(-20, 208)
        width, height = rng.integers(1, 80, 2) if rng.random() < 0.5 else rng.integers(1, 14, 2)
        color = np.array((RED, GREEN, BLUE)[rng.integers(3)]) * rng.uniform(0.4, 1.25)
        image[max(y, 0) : max(y + height, 0), max(x, 0) : max(x + width, 0)] = color
        if rng.random() < 0.4:
            holes = rng.random((208, 316)) < 0.02 * rng.integers(1, 10)
            image[holes] = rng.integers(0, 256, 3)
    image += rng.normal(0, rng.choice((0.0, 1.0, 3.0, 8.0)), image.shape)
    speckled = rng.random((208, 316)) < rng.choice((0.0, 0.01, 0.2))
    image[speckled] = rng.integers(0, 256, (np.count_nonzero(speckled), 3))
    return np.clip(image, 0, 255).astype(np.uint8)


def row_segments(detector: BlockDetector, picture: npt.NDArray[np.uint8]) -> list[tuple[int, int, int, int]]:
    """A detector's row segments (signature, row, start cell, length) in the order of the scan; a cell is 2 x 1 px."""
    found = detector._scanner.scan(checked(picture))
    columns = (found.signature, found.row, found.start, found.end - found.start)
    return list(zip(*(column.tolist() for column in columns), strict=True))
