"""The rule table of the paper's visual algorithm, row by row, and the geometry behind its fine-tuning."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.alignment.mode import Decision, Verdict
from robot_formation.alignment.observation import bounding_boxes
from robot_formation.alignment.paper_mode import AlignmentParameters, PaperAlignment
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import from_mapping
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

P = AlignmentParameters()
NEAR, FAR = 60, 40  # side lengths [px] on both sides of the 50 px at the formation distance
IN_PLACE = Block(Face.TARGET, 158, 60, 49, 49)


def parameters(**values: float) -> AlignmentParameters:
    return from_mapping(AlignmentParameters, values, where="test")


def block(signature: int, side: int = 49, x: int = 158, y: int = 60) -> Block:
    return Block(signature, x, y, side, side)


def moves(found: Decision, x_m: float = 0.0, y_m: float = 0.0) -> None:
    assert found.verdict is Verdict.MOVE
    assert (found.motion.x_m, found.motion.y_m, found.motion.yaw_rad) == pytest.approx((x_m, y_m, 0.0))


FORWARD, BACK, AWAY = 1.0, -1.0, -1.0  # the neighbour is on the left, so away is to the right, -y


@pytest.mark.parametrize(
    ("blocks", "x_m", "y_m"),
    [
        ([block(Face.FRONT, FAR)], BACK * 0.05, 0.0),
        ([block(Face.FRONT, NEAR)], BACK * 0.05, AWAY * 0.05),
        ([block(Face.REAR, FAR)], FORWARD * 0.05, 0.0),
        ([block(Face.REAR, NEAR)], FORWARD * 0.05, AWAY * 0.05),
        ([block(Face.FRONT, NEAR), block(Face.TARGET, NEAR)], BACK * 0.02, 0.0),
        ([block(Face.TARGET, FAR), block(Face.FRONT, FAR)], BACK * 0.02, 0.0),
        ([block(Face.REAR, NEAR), block(Face.TARGET, NEAR)], FORWARD * 0.02, 0.0),
        ([block(Face.TARGET, FAR), block(Face.REAR, FAR)], FORWARD * 0.02, 0.0),
        ([block(Face.FRONT, FAR), block(Face.REAR, FAR)], 0.0, AWAY * 0.05),
        ([block(Face.FRONT), block(Face.TARGET), block(Face.REAR)], 0.0, AWAY * 0.05),
        ([block(Face.FRONT, 20, 140, 60), block(Face.FRONT, 18, 159, 60)], BACK * 0.05, 0.0),
    ],
    ids=[
        "front only, far: back",
        "front only, near: back and away",
        "rear only, far: forward",
        "rear only, near: forward and away",
        "front and target: a fine step back",
        "target and front: a fine step back",
        "rear and target: a fine step forward",
        "target and rear: a fine step forward",
        "front and rear: away",
        "all three: away",
        "front split by flicker: as one",
    ],
)
def test_every_row_of_the_rule_table_moves_in_its_direction(blocks: list[Block], x_m: float, y_m: float) -> None:
    moves(PaperAlignment(P).assess(blocks), x_m, y_m)
    moves(PaperAlignment(P).assess(blocks[::-1]), x_m, y_m)


def test_the_steps_outside_the_target_area_are_parameters() -> None:
    alignment = PaperAlignment(parameters(coarse_step_m=0.04, fine_step_m=0.01))
    moves(alignment.assess([block(Face.FRONT, NEAR)]), -0.04, -0.04)
    moves(alignment.assess([block(Face.REAR), block(Face.TARGET)]), 0.01)


def test_near_and_far_part_at_the_side_length_of_the_formation_distance_taken_with_the_detectors_bias() -> None:
    exact = P.side_px_m / P.distance_m - P.side_bias_px  # what the detector reports in formation
    alignment = PaperAlignment(P)
    below, above = math.floor(exact), math.floor(exact) + 1
    assert below < exact < above
    moves(alignment.assess([Block(Face.FRONT, 158, 60, 10, below)]), BACK * 0.05)
    moves(alignment.assess([Block(Face.FRONT, 158, 60, above, 10)]), BACK * 0.05, AWAY * 0.05)


@pytest.mark.parametrize("signature", [4, 5, 7, 0, 12])
def test_blocks_that_are_not_the_markers_count_as_nothing(signature: int) -> None:
    alignment = PaperAlignment(P)
    assert alignment.assess([block(signature)]).verdict is Verdict.LOOK
    assert alignment.assess([IN_PLACE, block(signature, 80, 20)]).verdict is Verdict.ALIGNED


def test_target_in_its_place_is_aligned() -> None:
    found = PaperAlignment(P).assess([IN_PLACE])
    assert found.verdict is Verdict.ALIGNED
    assert found.motion == Motion()


@pytest.mark.parametrize(("x", "verdict"), [(95, "move"), (96, "aligned"), (104, "aligned"), (105, "move")])
def test_the_column_is_inside_up_to_the_tolerance_itself(x: int, verdict: str) -> None:
    alignment = PaperAlignment(parameters(target_x_px=100.0, v_tolerance_px=4.0))
    found = alignment.assess([block(Face.TARGET, x=x)])
    assert found.verdict.value == verdict
    if verdict == "move":
        assert math.copysign(1, found.motion.x_m) == math.copysign(1, x - 100)


@pytest.mark.parametrize(("side", "verdict"), [(39, "move"), (41, "aligned"), (66, "aligned"), (67, "move")])
def test_the_distance_is_inside_up_to_the_tolerance(side: int, verdict: str) -> None:
    # Without bias: 10 px m / 50 px = 0.2 m; the tolerance of 5 cm ends at 0.25 m (40 px) and 0.15 m (66.7 px).
    alignment = PaperAlignment(parameters(side_px_m=10.0, side_bias_px=0.0, distance_m=0.2, u_tolerance_m=0.05))
    found = alignment.assess([block(Face.TARGET, side)])
    assert found.verdict.value == verdict
    if verdict == "move":
        moves(found, y_m=10.0 / side - 0.2)


def test_a_distance_exactly_at_the_tolerance_is_inside() -> None:
    alignment = PaperAlignment(parameters(side_px_m=16.0, side_bias_px=0.0, distance_m=0.25, u_tolerance_m=0.25))
    assert alignment.assess([block(Face.TARGET, 32)]).verdict is Verdict.ALIGNED  # 16/32 - 0.25 = 0.25 exactly


@pytest.mark.parametrize(
    ("width", "height", "turns"), [(45, 49, False), (49, 45, False), (44, 49, True), (49, 44, True)]
)
def test_side_lengths_may_differ_by_the_tolerance_itself(width: int, height: int, turns: bool) -> None:
    found = PaperAlignment(P).assess([Block(Face.TARGET, 158, 60, width, height)])
    assert (found.verdict is Verdict.MOVE) == turns
    assert abs(found.motion.yaw_rad) == (pytest.approx(math.radians(5.0)) if turns else 0.0)


def test_v_comes_before_u_and_u_before_the_turn() -> None:
    alignment = PaperAlignment(P)
    first = alignment.assess([Block(Face.TARGET, 200, 60, 20, 30)])
    second = alignment.assess([Block(Face.TARGET, 158, 60, 20, 30)])
    third = alignment.assess([Block(Face.TARGET, 158, 60, 40, 49)])
    assert [found.reason for found in (first, second, third)] == ["fine-tune v", "fine-tune u", "turn"]
    for found, component in ((first, "x_m"), (second, "y_m"), (third, "yaw_rad")):
        others = {"x_m", "y_m", "yaw_rad"} - {component}
        assert getattr(found.motion, component) != 0.0
        assert all(getattr(found.motion, other) == 0.0 for other in others)


def test_single_corrections_are_cut_to_their_longest_step() -> None:
    alignment = PaperAlignment(parameters(max_v_step_m=0.06, max_u_step_m=0.03))
    moves(alignment.assess([block(Face.TARGET, x=300)]), x_m=0.06)
    moves(alignment.assess([block(Face.TARGET, x=20)]), x_m=-0.06)
    moves(alignment.assess([block(Face.TARGET, side=20)]), y_m=0.03)
    moves(alignment.assess([block(Face.TARGET, side=120)]), y_m=-0.03)


def turn_of(alignment: PaperAlignment, difference: int) -> float:
    return alignment.assess([Block(Face.TARGET, 158, 60, 49 - difference, 49)]).motion.yaw_rad


def test_a_turn_goes_on_while_it_helps_and_reverses_each_time_it_made_things_worse() -> None:
    alignment = PaperAlignment(P)
    step = P.turn_step_rad
    signs = [turn_of(alignment, difference) / step for difference in (8, 7, 6, 9, 8, 8, 10, 5)]
    #        better, better, worse (reversed), better, equal, worse (reversed), better
    assert signs == pytest.approx([1, 1, 1, -1, -1, -1, 1, 1])


def test_after_the_bound_of_moves_the_follower_goes_on_unaligned_with_the_reason() -> None:
    alignment = PaperAlignment(parameters(max_moves=3))
    for _ in range(3):
        assert alignment.assess([block(Face.TARGET, x=200)]).verdict is Verdict.MOVE
    found = alignment.assess([block(Face.TARGET, x=200)])
    assert found.verdict is Verdict.UNALIGNED
    assert "3 moves" in found.reason
    assert "fine-tune v" in found.reason


def test_the_last_move_allowed_may_still_align() -> None:
    alignment = PaperAlignment(parameters(max_moves=1))
    assert alignment.assess([block(Face.TARGET, x=200)]).verdict is Verdict.MOVE
    assert alignment.assess([IN_PLACE]).verdict is Verdict.ALIGNED


def test_the_papers_bound_is_14_moves() -> None:
    alignment = PaperAlignment(P)
    verdicts = [alignment.assess([block(Face.FRONT)]).verdict for _ in range(15)]
    assert verdicts == [Verdict.MOVE] * 14 + [Verdict.UNALIGNED]


def test_empty_looks_are_repeated_and_at_their_bound_the_leader_is_lost() -> None:
    alignment = PaperAlignment(parameters(max_empty_looks=3))
    assert [alignment.assess([]).verdict for _ in range(3)] == [Verdict.LOOK, Verdict.LOOK, Verdict.LOST]


def test_empty_looks_count_only_in_a_row() -> None:
    alignment = PaperAlignment(parameters(max_empty_looks=2))
    assert alignment.assess([]).verdict is Verdict.LOOK
    assert alignment.assess([block(Face.TARGET, x=200)]).verdict is Verdict.MOVE
    assert alignment.assess([]).verdict is Verdict.LOOK
    assert alignment.assess([]).verdict is Verdict.LOST


def test_two_blocks_of_one_signature_are_one_box() -> None:
    left, right = Block(Face.TARGET, 145, 60, 20, 48), Block(Face.TARGET, 171, 62, 24, 44)
    (box,) = bounding_boxes([left, right]).values()
    assert (box.left, box.right, box.top, box.bottom) == (135, 183, 36, 84)
    assert (box.x, box.width, box.height, box.side) == (159, 48, 48, 48)
    assert PaperAlignment(P).assess([left, right]).verdict is Verdict.ALIGNED


blocks = st.builds(
    Block,
    st.integers(1, 4),
    st.integers(0, 315),
    st.integers(0, 207),
    st.integers(1, 316),
    st.integers(1, 208),
)


@given(found=st.lists(blocks, max_size=6))
def test_a_bounding_box_holds_its_blocks_and_no_edge_lies_elsewhere(found: list[Block]) -> None:
    boxes = bounding_boxes(found)
    assert set(boxes) == {b.signature for b in found} - {4}
    for signature, box in boxes.items():
        members = [b for b in found if b.signature == signature]
        assert box.left == min(b.x - b.width / 2 for b in members)
        assert box.right == max(b.x + b.width / 2 for b in members)
        assert box.top == min(b.y - b.height / 2 for b in members)
        assert box.bottom == max(b.y + b.height / 2 for b in members)


@given(looks=st.lists(st.lists(blocks, max_size=4), min_size=1, max_size=25))
def test_whatever_is_seen_moves_stay_in_the_drives_range_and_in_number(looks: list[list[Block]]) -> None:
    alignment = PaperAlignment(P)
    found = [alignment.assess(look) for look in looks]
    for decision in found:
        assert abs(decision.motion.x_m) <= 0.2
        assert abs(decision.motion.y_m) <= 0.1
        assert abs(decision.motion.yaw_rad) <= math.radians(5.0)
        assert (decision.motion != Motion()) <= (decision.verdict is Verdict.MOVE)
    assert sum(decision.verdict is Verdict.MOVE for decision in found) <= P.max_moves


# An ideal pinhole camera: 273.7 px focal length, axis through column 157.5, 32.8 cm before a 6 cm face in formation.
FOCAL_PX, CENTRE_PX, EDGE_M, DISTANCE_M = 273.7, 157.5, 0.06, 0.328
PINHOLE = parameters(
    target_x_px=CENTRE_PX,
    slope_px_per_m=FOCAL_PX / DISTANCE_M,
    side_px_m=FOCAL_PX * EDGE_M,
    side_bias_px=0.0,
    distance_m=DISTANCE_M,
)


def seen_from(x_m: float, y_m: float) -> Block:
    """What a pinhole camera that looks left reports of the Target face when the follower is at (x, y) of its place."""
    distance = DISTANCE_M - y_m  # further left is nearer to the face
    ahead = -x_m  # the face's middle lies behind a follower that is too far forward
    side = FOCAL_PX * EDGE_M / distance
    return Block(Face.TARGET, round(CENTRE_PX + FOCAL_PX * ahead / distance), 60, round(side), round(side))


@given(x=st.floats(-0.03, 0.03), y=st.floats(-0.08, 0.08))
def test_the_residual_is_the_way_to_the_place_as_a_pinhole_camera_tells_it(x: float, y: float) -> None:
    residual = PaperAlignment(PINHOLE).offset([seen_from(x, y)])
    assert residual is not None
    # Half a pixel of the side, and of the column scaled by how much nearer or farther the face is than in formation.
    scale = DISTANCE_M / (DISTANCE_M - y)
    assert residual.x_m == pytest.approx(-x * scale, abs=0.51 / PINHOLE.slope_px_per_m)
    side = FOCAL_PX * EDGE_M / (DISTANCE_M - y)
    assert residual.y_m == pytest.approx(-y, abs=(DISTANCE_M - y) * 0.51 / (side - 0.5))
    assert residual.yaw_rad == 0.0


def test_without_the_target_face_there_is_no_residual() -> None:
    alignment = PaperAlignment(P)
    assert alignment.offset([]) is None
    assert alignment.offset([block(Face.FRONT), block(Face.REAR)]) is None
    assert alignment.offset([block(Face.FRONT), block(Face.TARGET)]) is not None


def test_the_default_calibration_is_near_that_of_the_pinhole_camera() -> None:
    assert P.slope_px_per_m == pytest.approx(PINHOLE.slope_px_per_m, rel=0.02)
    assert P.side_px_m == pytest.approx(PINHOLE.side_px_m, rel=0.02)
    assert P.target_x_px == pytest.approx(CENTRE_PX, abs=1.5)


@given(x=st.floats(-0.03, 0.03), y=st.floats(-0.05, 0.05))
def test_carried_out_exactly_the_corrections_lead_into_the_tolerances(x: float, y: float) -> None:
    alignment = PaperAlignment(PINHOLE)
    for _ in range(8):
        found = alignment.assess([seen_from(x, y)])
        if found.verdict is not Verdict.MOVE:
            break
        x, y = x + found.motion.x_m, y + found.motion.y_m
    assert found.verdict is Verdict.ALIGNED
    assert abs(x) <= 5.5 / PINHOLE.slope_px_per_m * 1.06
    assert abs(y) <= 0.015 + 0.004  # half a pixel of 50 is 3.3 mm of the distance
