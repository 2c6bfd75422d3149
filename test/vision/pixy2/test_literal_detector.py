"""The fast detector agrees with the slow, literal reading of the rules on a thousand random pictures."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from robot_formation.vision.pixy2.color_table import ColorTable
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from vision_helpers import GROUPS, PARAMETERS, random_picture, row_segments
from vision_literal import LiteralDetector

SETTINGS = {
    "default": DetectorParameters(),
    "paper": replace(PARAMETERS["paper"], signature_range=(5.0, 6.0, 6.0)),
    "wide and few": DetectorParameters(
        signature_range=(15.0, 20.0, 25.0), min_block_area=4, max_merge_dist=0, max_blocks=9, max_blocks_per_signature=4
    ),
}


@functools.cache
def pair(name: str) -> tuple[BlockDetector, LiteralDetector]:
    return BlockDetector(GROUPS["G1"], SETTINGS[name]), LiteralDetector(GROUPS["G1"], SETTINGS[name])


@pytest.mark.parametrize(
    ("name", "seeds"),
    [
        ("default", range(112)),
        pytest.param("default", range(112, 336), marks=pytest.mark.long),
        *(pytest.param(name, range(336), marks=pytest.mark.long) for name in ("paper", "wide and few")),
    ],
)
def test_random_pictures_give_the_segments_and_boxes_of_the_literal_reading(name: str, seeds: range) -> None:
    fast, literal = pair(name)
    for seed in seeds:
        image = random_picture(np.random.default_rng(seed))
        assert row_segments(fast, image) == literal.row_segments(image), f"segments, seed {seed}"
        boxes = [(box.signature, box.left, box.right, box.top, box.bottom) for box in fast.detect(image)]
        assert boxes == literal.detect(image), f"boxes, seed {seed}"


@pytest.mark.parametrize("name", SETTINGS)
def test_the_color_table_is_that_of_the_literal_reading(name: str) -> None:
    _, literal = pair(name)
    labels = ColorTable.of(GROUPS["G1"], SETTINGS[name]).labels
    bins = [(iu, iv) for iu in range(-32, 32) for iv in range(-32, 32)]
    assert [labels[64 * iu + iv] for iu, iv in bins] == [literal.table[64 * (iu & 63) + (iv & 63)] for iu, iv in bins]
