"""From blocks to edges: which are trusted, which bias is taken off, and what a face that isn't reported tells."""

import pytest

from robot_formation.alignment.observation import MARGIN_PX, FaceBox
from robot_formation.alignment.precise.marker_edges import (
    Edge,
    EdgeParameters,
    View,
    hidden,
    mean_boxes,
    one_marker,
    sliver,
    view,
)
from robot_formation.parameters import ParameterError
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.picture import HEIGHT, WIDTH

P = EdgeParameters()
TARGET = FaceBox(130.0, 180.0, 60.0, 110.0)
FRONT = FaceBox(182.0, 202.0, 60.0, 110.0)
REAR = FaceBox(110.0, 128.0, 60.0, 110.0)


def edges(**boxes: FaceBox) -> dict[tuple[Face, str], Edge]:
    """The edges of a look by face and side."""
    seen = view({Face[name.upper()]: box for name, box in boxes.items()}, P)
    return {(edge.face, edge.side): edge for edge in seen.edges}


def test_a_target_face_alone_gives_all_four_edges_without_the_detectors_bias() -> None:
    found = edges(target=TARGET)
    positions = {side: edge.position_px for (_, side), edge in found.items()}
    assert positions == pytest.approx(
        {
            "left": 130.0 - P.target_left_px,
            "right": 180.0 - P.target_right_px,
            "top": 60.0 - P.target_top_px,
            "bottom": 110.0 - P.target_bottom_px,
        }
    )
    assert {edge.sigma_px for edge in found.values()} == {P.column_sigma_px, P.row_sigma_px}


def test_where_two_faces_meet_the_right_one_tells_the_common_edge() -> None:
    assert (Face.TARGET, "right") not in edges(target=TARGET, front=FRONT)
    assert (Face.FRONT, "left") in edges(target=TARGET, front=FRONT)
    assert (Face.REAR, "right") not in edges(target=TARGET, rear=REAR)
    assert (Face.TARGET, "left") in edges(target=TARGET, rear=REAR)


def test_beside_a_front_block_the_left_edge_of_the_target_is_later_and_less_sharp() -> None:
    alone, beside = edges(target=TARGET)[Face.TARGET, "left"], edges(target=TARGET, front=FRONT)[Face.TARGET, "left"]
    assert beside.position_px < alone.position_px
    assert beside.sigma_px > alone.sigma_px


@pytest.mark.parametrize(("width_px", "band"), [(9.0, 0), (10.0, 1), (12.9, 1), (17.0, 2), (18.0, 3), (40.0, 3)])
def test_the_bias_of_an_outer_edge_is_that_of_its_band_of_widths(width_px: float, band: int) -> None:
    front = FaceBox(182.0, 182.0 + width_px, 60.0, 110.0)
    edge = edges(target=TARGET, front=front)[Face.FRONT, "right"]
    assert edge.position_px == pytest.approx(front.right - P.front_right_px[band])
    assert edge.sigma_px == P.front_right_sigma_px[band]


@pytest.mark.parametrize("target", [None, FaceBox(150.0, 180.0, 60.0, 110.0), FaceBox(140.0, 180.0, 60.0, 100.0)])
def test_in_views_that_are_not_clear_the_rough_values_hold(target: FaceBox | None) -> None:
    assert not P.clear(target)
    boxes = {"front": FRONT, "rear": REAR} | ({} if target is None else {"target": target})
    found = edges(**boxes)
    assert found[Face.FRONT, "right"].position_px == pytest.approx(FRONT.right - P.rough_front_right_px)
    assert found[Face.REAR, "left"].position_px == pytest.approx(REAR.left - P.rough_rear_left_px)
    assert found[Face.FRONT, "right"].sigma_px == found[Face.REAR, "left"].sigma_px == P.rough_sigma_px


def test_the_rows_are_those_of_the_widest_face() -> None:
    broken = FaceBox(182.0, 202.0, 80.0, 90.0)
    found = edges(target=TARGET, front=broken)
    assert (Face.FRONT, "top") not in found
    assert found[Face.TARGET, "top"].position_px == pytest.approx(60.0 - P.target_top_px)
    assert edges(front=FRONT)[Face.FRONT, "top"].sigma_px > P.row_sigma_px


def test_edges_at_the_pictures_border_are_left_out_and_rows_of_a_cut_face_count_less() -> None:
    found = edges(target=FaceBox(-1.0, 40.0, 60.0, 110.0))
    assert set(found) == {(Face.TARGET, side) for side in ("right", "top", "bottom")}
    assert found[Face.TARGET, "top"].sigma_px > 3.0 * P.row_sigma_px
    low = edges(target=FaceBox(130.0, 180.0, 160.0, HEIGHT - 1.0))
    assert (Face.TARGET, "bottom") not in low
    inside = P.target_right_px + WIDTH - MARGIN_PX
    assert (Face.TARGET, "right") in edges(target=FaceBox(250.0, inside - 0.1, 60.0, 110.0))
    assert (Face.TARGET, "right") not in edges(target=FaceBox(250.0, inside + 0.1, 60.0, 110.0))


def test_a_look_without_blocks_has_no_edges_and_bounds_every_face() -> None:
    empty = view({}, P)
    assert empty == View((), frozenset())
    assert {edge.face: edge.position_px for edge in hidden(empty, P)} == {
        Face.TARGET: P.front_shows_px,
        Face.FRONT: P.front_shows_px,
        Face.REAR: P.rear_shows_px,
    }
    assert {edge.face for edge in hidden(view({Face.TARGET: TARGET}, P), P)} == {Face.FRONT, Face.REAR}


def test_a_sliver_of_the_front_face_moves_the_target_blocks_right_edge() -> None:
    edge = Edge(Face.TARGET, "right", 180.0, 0.9)
    assert sliver(edge, P.sliver_from_px, P) == edge
    assert sliver(edge, P.sliver_to_px, P).position_px == pytest.approx(180.0 - P.sliver_px)
    halfway = sliver(edge, 0.5 * (P.sliver_from_px + P.sliver_to_px), P)
    assert halfway.position_px == pytest.approx(180.0 - 0.5 * P.sliver_px)
    assert halfway.sigma_px == pytest.approx(0.9 + 0.5 * P.sliver_px)


def test_one_marker_keeps_the_pieces_of_a_split_face() -> None:
    upper, lower = Block(Face.TARGET, 158, 40, 48, 20, index=0), Block(Face.TARGET, 158, 66, 48, 24, index=1)
    far = Block(Face.TARGET, 40, 150, 30, 30, index=2)
    other = Block(Face.FRONT, 200, 50, 20, 48, index=3)
    kept = one_marker([far, lower, other, upper], lambda block: -block.width * block.height)
    assert {block.index for block in kept} == {0, 1, 3}


def test_a_look_averages_the_frames_that_show_the_same_faces_as_the_last() -> None:
    target, front = Block(Face.TARGET, 100, 50, 40, 40, index=0), Block(Face.FRONT, 130, 50, 20, 40, index=1)
    shifted = Block(Face.TARGET, 104, 50, 40, 40, index=0)
    boxes = mean_boxes([[target, front], [target], [shifted]])
    assert set(boxes) == {Face.TARGET}
    assert boxes[Face.TARGET].x == pytest.approx(102.0)
    assert mean_boxes([]) == {}


@pytest.mark.parametrize(
    ("widths", "values"), [((10.0, 9.0), (0.0, 0.0, 0.0)), ((9.0, 10.0), (0.0, 0.0)), ((), (0.0, 0.0))]
)
def test_bands_that_do_not_ascend_or_part_the_values_are_refused(
    widths: tuple[float, ...], values: tuple[float, ...]
) -> None:
    with pytest.raises(ParameterError, match="front_widths_px"):
        EdgeParameters(front_widths_px=widths, front_right_px=values, front_right_sigma_px=(1.0,) * len(values))
