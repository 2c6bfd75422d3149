"""Properties of the detector that hold for every picture."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from robot_formation.vision.pixy2.boxes import Box
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture import PictureError
from vision_helpers import BLUE, GREEN, GROUPS, RED, canvas, random_picture, row_segments

WIDE = DetectorParameters(signature_range=(15.0, 20.0, 20.0), min_block_area=4)
DETECTOR = BlockDetector(GROUPS["G1"], WIDE)


def sides(box: Box) -> tuple[int, int, int, int, int]:
    return box.signature, box.left, box.right, box.top, box.bottom


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.integers(0, 20))
def test_moving_the_scene_by_cells_and_rows_moves_the_boxes_alike(seed: int, cells: int, rows: int) -> None:
    image = random_picture(np.random.default_rng(seed))
    before = canvas(background=(128, 128, 128))
    before[30:170, 40:260] = image[30:170, 40:260]
    after = np.roll(before, (rows, 2 * cells), axis=(0, 1))
    moved = [
        (s, left + 2 * cells, right + 2 * cells, top + rows, bottom + rows)
        for s, left, right, top, bottom in map(sides, DETECTOR.detect(before))
    ]
    assert [sides(box) for box in DETECTOR.detect(after)] == moved


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_columns_with_odd_numbers_are_never_looked_at(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = random_picture(rng)
    other = image.copy()
    other[:, 1::2] = rng.integers(0, 256, (208, 158, 3))
    assert DETECTOR.detect(image) == DETECTOR.detect(other)


@settings(max_examples=50, deadline=None)
@given(arrays.arrays(np.uint8, (208, 316, 3), elements=st.integers(0, 255), fill=st.integers(0, 255)))
def test_any_picture_gives_boxes_inside_the_frame(image: npt.NDArray[np.uint8]) -> None:
    for box in DETECTOR.detect(image):
        assert 0 <= box.left < box.right <= 316
        assert 0 <= box.top < box.bottom <= 207
        assert box.left % 2 == box.right % 2 == 0


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_a_picture_of_one_color_never_gives_more_than_one_box(color: tuple[int, int, int]) -> None:
    assert len(DETECTOR.detect(canvas(background=color))) <= 1


def test_a_picture_full_of_a_taught_color_is_one_box_without_the_last_row() -> None:
    (box,) = DETECTOR.detect(canvas(background=RED))
    assert sides(box) == (1, 0, 316, 0, 206)


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_pictures_hold_no_box(level: int) -> None:
    assert DETECTOR.detect(canvas(background=(level,) * 3)) == []


def test_pure_noise_does_not_crash_and_boxes_stay_within_the_limit() -> None:
    image = np.random.default_rng(1).integers(0, 256, (208, 316, 3), np.uint8)
    everything = replace(WIDE, signature_range=(25.0,) * 3, min_brightness=0.0, max_blocks=5)
    assert len(BlockDetector(GROUPS["G1"], everything).detect(image)) <= 5


def test_a_rectangle_has_its_true_left_edge_and_a_right_edge_short_by_the_stride() -> None:
    # Cells 50..69: hits at 51, 55, 59, 63, 67; the segment reaches one cell past the last hit.
    (box,) = DETECTOR.detect(canvas(((100, 60, 40, 30), RED)))
    assert sides(box) == (1, 100, 136, 60, 89)


def test_another_rectangle_to_the_right_costs_the_left_one_its_first_cell() -> None:
    boxes = DETECTOR.detect(canvas(((100, 60, 40, 30), RED), ((200, 60, 40, 30), BLUE)))
    assert [sides(box) for box in boxes] == [(1, 102, 136, 60, 89), (3, 200, 236, 60, 89)]


@pytest.mark.parametrize(("empty_rows", "count"), [(3, 1), (4, 2)])
def test_boxes_merge_across_rows_up_to_the_distance(empty_rows: int, count: int) -> None:
    detector = BlockDetector(GROUPS["G1"], replace(WIDE, max_merge_dist=4))
    upper, lower = ((100, 60, 40, 20), RED), ((100, 80 + empty_rows, 40, 20), RED)
    assert len(detector.detect(canvas(upper, lower))) == count


def test_a_box_of_another_color_inside_a_box_is_dropped() -> None:
    boxes = DETECTOR.detect(canvas(((100, 60, 80, 60), RED), ((120, 80, 20, 20), GREEN)))
    assert [box.signature for box in boxes] == [1]


def test_the_table_is_rebuilt_when_parameters_change_but_blocks_keep_their_index() -> None:
    detector = BlockDetector(GROUPS["G1"], replace(WIDE, block_filtering=0))
    image = canvas(((100, 60, 40, 30), RED))
    detector.process(image, 0)
    (before,) = detector.process(image, 16_200)
    detector.configure(detector.signatures, replace(detector.parameters, min_block_area=30))
    (after,) = detector.process(image, 32_400)
    assert (after.index, after.age) == (before.index, before.age + 1)
    detector.configure(detector.signatures, replace(detector.parameters, min_block_area=2500))
    assert detector.detect(image) == []


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((208, 316), np.uint8),
        np.zeros((316, 208, 3), np.uint8),
        np.zeros((208, 316, 4), np.uint8),
        np.zeros((208, 316, 3), np.float32),
        None,
    ],
)
def test_a_picture_of_another_shape_or_type_is_refused_in_one_line(
    image: npt.NDArray[np.float32] | npt.NDArray[np.uint8],
) -> None:
    with pytest.raises(PictureError) as error:
        DETECTOR.detect(image)
    assert "\n" not in str(error.value)


def test_a_view_with_gaps_is_read_like_its_copy() -> None:
    large = np.random.default_rng(3).integers(0, 256, (416, 632, 3), np.uint8)
    view = large[::2, ::2]
    assert row_segments(DETECTOR, view) == row_segments(DETECTOR, view.copy())
