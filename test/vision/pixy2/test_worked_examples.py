"""Every worked example agrees exactly; only the order among blocks of equal area is free."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import pytest

from cases import case
from robot_formation.vision.pixy2.color_table import run_time_bounds
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.signatures import teach_point, teach_region
from vision_helpers import EXAMPLES, GROUPS, PARAMETERS, picture, row_segments


def by_area(blocks: Sequence[dict[str, int]]) -> list[dict[str, int]]:
    return sorted(blocks, key=lambda block: (-block["width"] * block["height"], sorted(block.items())))


def label(example: dict[str, Any]) -> str:
    return f"{example['image']}-{example.get('sig', '')}-{example.get('grow_dist', '')}"


def test_teaching_stores_the_bounds_and_accepts_the_blocks_of_the_example() -> None:
    for example in EXAMPLES["teach"]:
        with case(label(example)):
            check_teaching(example)


def check_teaching(example: dict[str, Any]) -> None:
    image = picture(example["image"])
    if example["kind"] == "region":
        signature = teach_region(image, example["region"], example["sig"])
        gain = PARAMETERS["paper"].range_of(signature.sig)
        assert run_time_bounds(signature, gain) == tuple(example["runtime_paper"].values())
    else:
        point = tuple(example["point"])
        signature, blocks = teach_point(image, point, example["grow_dist"], example["sig"])
        assert [list(block) for block in blocks] == example["points"]
    assert signature.to_mapping() == example["result"]


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_picture_shown_twice_gives_the_blocks_of_the_example(name: str) -> None:
    for example in EXAMPLES["images"]:
        with case(label(example)):
            check_blocks(example, name)


def check_blocks(example: dict[str, Any], name: str) -> None:
    detector = BlockDetector(GROUPS[example["group"]], replace(PARAMETERS[name], block_filtering=0))
    image = picture(example["image"])
    assert detector.process(image, 0) == []
    blocks = [asdict(block) for block in detector.process(image, 16_200)]
    assert by_area(blocks) == by_area(example["expected"][name])


def test_row_segments_are_those_of_the_example() -> None:
    for example in EXAMPLES["images"]:
        detector = BlockDetector(GROUPS[example["group"]], PARAMETERS["paper"])
        segments = row_segments(detector, picture(example["image"]))
        assert [list(segment) for segment in segments] == example["row_segments_paper"], label(example)


@pytest.mark.parametrize("sequence", EXAMPLES["sequences"], ids=lambda sequence: sequence["name"])
def test_a_sequence_is_tracked_with_the_index_and_age_of_the_example(
    sequence: dict[str, Any],
) -> None:
    detector = BlockDetector(GROUPS[sequence["group"]], PARAMETERS[sequence["params"]])
    time_us = 1_700_000_000_000_000
    for number, frame in enumerate(sequence["frames"]):
        time_us += frame["dt_us"] if number else 0
        blocks = [asdict(block) for block in detector.process(picture(frame["image"]), time_us)]
        assert by_area(blocks) == by_area(frame["expected"]), f"frame {number}"
