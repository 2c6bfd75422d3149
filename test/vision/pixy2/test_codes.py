"""Colour codes: neighbouring boxes of code signatures read as octal digits."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from robot_formation.vision.pixy2.boxes import Box
from robot_formation.vision.pixy2.codes import with_codes
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from vision_helpers import BLUE, GREEN, GROUPS, RED, canvas

WIDE = DetectorParameters(signature_range=(15.0, 20.0, 20.0))


def detector(mode: int, types: tuple[int, int, int] = (1, 1, 1)) -> BlockDetector:
    signatures = [replace(signature, type=kind) for signature, kind in zip(GROUPS["G1"], types, strict=True)]
    return BlockDetector(signatures, replace(WIDE, color_code_mode=mode))


def codes(*parts: Box, keep_single: bool = False) -> list[Box]:
    return with_codes([], list(parts), keep_single=keep_single)


LEFT_RIGHT = canvas(((100, 60, 40, 40), RED), ((140, 60, 40, 40), GREEN))
RIGHT_LEFT = canvas(((100, 60, 40, 40), GREEN), ((140, 60, 40, 40), RED))
TOP_DOWN = canvas(((100, 20, 40, 40), RED), ((100, 60, 40, 40), GREEN), ((100, 100, 40, 40), BLUE))


@pytest.mark.parametrize(
    ("image", "code", "angle"), [(LEFT_RIGHT, 0o12, 0), (RIGHT_LEFT, 0o12, 180), (TOP_DOWN, 0o123, -90)]
)
def test_a_code_is_read_in_the_direction_of_the_smaller_number(
    image: npt.NDArray[np.uint8], code: int, angle: int
) -> None:
    (box,) = detector(mode=1).detect(image)
    assert (box.signature, box.angle) == (code, angle)


def test_the_box_of_a_code_is_the_bounding_box_of_its_parts() -> None:
    (box,) = detector(mode=1).detect(TOP_DOWN)
    assert (box.left, box.top, box.bottom) == (100, 20, 139)


@pytest.mark.parametrize(
    ("mode", "types", "signatures"),
    [
        (0, (1, 1, 1), [1, 2]),
        (1, (0, 0, 0), [1, 2]),
        (1, (1, 0, 1), [2]),
        (2, (0, 0, 0), [0o12]),
        (3, (1, 0, 1), [2, 1]),
        (3, (1, 1, 1), [0o12]),
    ],
)
def test_the_mode_decides_which_signatures_make_codes_and_whether_single_boxes_stay(
    mode: int, types: tuple[int, int, int], signatures: list[int]
) -> None:
    assert [box.signature for box in detector(mode, types).detect(LEFT_RIGHT)] == signatures


@pytest.mark.parametrize(("gap", "count"), [(8, 1), (9, 0)])
def test_parts_of_a_code_are_at_most_eight_pixels_apart(gap: int, count: int) -> None:
    assert len(codes(Box(1, 0, 20, 0, 20), Box(2, 20 + gap, 40 + gap, 0, 20))) == count


def test_parts_much_smaller_than_the_others_do_not_count() -> None:
    big, small = Box(1, 0, 40, 0, 40), Box(3, 42, 48, 0, 6)
    assert codes(big, Box(2, 0, 40, 42, 82), small)[0].signature == 0o12


def test_adjacent_parts_of_one_signature_count_once() -> None:
    (code,) = codes(Box(1, 0, 20, 0, 9), Box(1, 4, 20, 11, 20), Box(2, 22, 42, 0, 20))
    assert code.signature == 0o12


def test_a_code_has_at_most_five_digits() -> None:
    row = [Box(1 + n % 2, 20 * n, 20 * n + 18, 0, 20) for n in range(7)]
    assert codes(*row)[0].signature == 0o12121


def test_single_parts_are_dropped_unless_they_are_to_be_kept() -> None:
    single = Box(1, 0, 20, 0, 20)
    assert codes(single) == []
    assert codes(single, keep_single=True) == [single]
