"""The estimate of the neighbour's pose against the pose that made the pictures."""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alignment_helpers import BOWL_CURVATURE_PER_M, EDGES, MODEL, blocks_of, state_of
from robot_formation.alignment.observation import FaceBox, bounding_boxes
from robot_formation.alignment.precise.marker_edges import EdgeParameters
from robot_formation.alignment.precise.marker_projection import (
    SADDLE,
    SKEW,
    YAW,
    X,
    Y,
    after_motion,
    pose_of,
    relative_tilt,
)
from robot_formation.alignment.precise.pose_filter import FilterParameters, PoseFilter
from robot_formation.alignment.precise.step_models import Drives
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.block import Block

FORMATION = Motion(y_m=-FORMATION_DISTANCE_M)
AHEAD = UncertainMotion(Motion(0.05))
LOOKS_FROM = (0.135, -0.135, 0.12, -0.12)


def new_filter() -> PoseFilter:
    return PoseFilter(MODEL, EDGES, FilterParameters())


def look(pose_filter: PoseFilter, state: npt.NDArray[np.float64]) -> None:
    pose_filter.look(bounding_boxes(blocks_of(state)))


@settings(max_examples=12, deadline=None)
@given(st.floats(-0.02, 0.02), st.floats(0.29, 0.4), st.floats(-0.1, 0.1))
def test_place_and_relative_tilt_follow_from_one_look_in_formation(x_m: float, y_m: float, yaw_rad: float) -> None:
    state, found = state_of(x_m, y_m, yaw_rad), new_filter()
    look(found, state)
    # Without the relative tilt, the side length alone would put it 1.9 cm off.
    assert found.best.state[Y] == pytest.approx(y_m, abs=0.006)
    assert found.best.state[X] == pytest.approx(x_m, abs=0.01)  # up to its unknown heading
    ((roll,), _) = relative_tilt(found.best.state[None])
    assert roll == pytest.approx(BOWL_CURVATURE_PER_M * y_m, abs=0.01)


@settings(max_examples=8, deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.02, 0.02))
def test_the_heading_follows_from_looks_behind_and_ahead(yaw_rad: float, slip_m: float) -> None:
    truth, found = state_of(0.13, 0.33, yaw_rad), new_filter()
    look(found, truth)
    for x_m in LOOKS_FROM:
        motion = Motion(float(truth[X]) - x_m, slip_m)
        truth = after_motion(truth, motion)
        found.moved(motion)
        look(found, truth)
        slip_m = -slip_m
    assert found.best.state[YAW] == pytest.approx(yaw_rad, abs=math.radians(2.0))
    assert found.yaw_sigma_rad < math.radians(2.0)


@given(
    st.floats(-0.2, 0.2), st.floats(0.1, 0.8), st.floats(-1.0, 1.0), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2),
    st.floats(-1.0, 1.0),
)  # fmt: skip
def test_moves_compose(x_m: float, y_m: float, yaw_rad: float, dx_m: float, dy_m: float, turn_rad: float) -> None:
    state, motion = state_of(x_m, y_m, yaw_rad), Motion(dx_m, dy_m, turn_rad)
    way = motion.then(pose_of(after_motion(state, motion)).then(FORMATION))
    direct = pose_of(state).then(FORMATION)
    assert (way.x_m, way.y_m, way.yaw_rad) == pytest.approx((direct.x_m, direct.y_m, direct.yaw_rad), abs=1e-12)


@given(st.floats(-0.2, 0.2), st.floats(0.25, 0.8), st.floats(-1.0, 1.0))
def test_the_way_to_formation_leads_there(x_m: float, y_m: float, yaw_rad: float) -> None:
    state = state_of(x_m, y_m, yaw_rad)
    there = after_motion(state, pose_of(state).then(FORMATION))
    assert there[:3] == pytest.approx((0.0, FORMATION_DISTANCE_M, 0.0), abs=1e-12)


@pytest.mark.parametrize("turn_deg", [-9.0, 9.0])
def test_a_heading_that_is_wrongly_believed_is_found_from_behind_once_it_is_doubted(turn_deg: float) -> None:
    errors_deg = {}
    for doubt_rad in (0.0, 0.075):
        truth, found = state_of(0.0, 0.32, 0.0), new_filter()
        look(found, truth)
        found.assume_heading(math.radians(1.0))
        turned = truth.copy()
        turned[YAW] = math.radians(turn_deg)  # on the spot, unseen
        found.doubt_heading(doubt_rad)
        for x_m in (0.135, -0.135):
            turned_there = after_motion(turned, Motion(-x_m, 0.0))
            found.moved(Motion(-x_m, 0.0))
            look(found, turned_there)
            found.moved(Motion(x_m, 0.0))
        errors_deg[doubt_rad] = abs(math.degrees(float(found.best.state[YAW])) - turn_deg)
    assert errors_deg[0.075] < 2.5
    assert errors_deg[0.0] > errors_deg[0.075]


def test_the_covariance_stays_symmetric_and_positive() -> None:
    truth, found = state_of(0.05, 0.4, 0.2), new_filter()
    for motion in (Motion(), Motion(0.1, 0.05, 0.1), Motion(-0.15, 0.0, 0.05)):
        truth = after_motion(truth, motion)
        found.moved(motion)
        look(found, truth)
        for hypothesis in found.hypotheses:
            assert hypothesis.covariance == pytest.approx(hypothesis.covariance.T, abs=1e-12)
            assert np.linalg.eigvalsh(hypothesis.covariance).min() > 0.0


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.1, 0.1), st.floats(0.29, 0.4), st.floats(-0.8, 0.8), st.floats(0.4, 0.6), st.booleans())
def test_a_whole_marker_is_told_from_a_half_covered_face(
    x_m: float, y_m: float, yaw_rad: float, share: float, left: bool
) -> None:
    boxes = bounding_boxes(blocks_of(state_of(x_m, y_m, yaw_rad)))
    assert new_filter().whole(boxes)
    if set(boxes) == {Face.TARGET}:
        box = boxes[Face.TARGET]
        edge = box.left + share * box.width
        rest = replace(box, left=edge) if left else replace(box, right=edge)
        assert not new_filter().whole({Face.TARGET: rest})


@pytest.mark.parametrize("edges", [EDGES, EdgeParameters(target_top_px=0.0, target_bottom_px=0.0)])
def test_first_guesses_are_at_the_distance_of_the_height_without_the_detectors_bias(edges: EdgeParameters) -> None:
    depth_px_m = MODEL.parameters.focal_length_px * MODEL.parameters.marker_edge_m
    height_px = depth_px_m / 0.328 + edges.target_bottom_px - edges.target_top_px
    found = PoseFilter(MODEL, edges, FilterParameters())
    guesses = found._guesses({Face.TARGET: FaceBox(133.0, 183.0, 60.0, 60.0 + height_px)})
    (straight,) = (guess for guess in guesses if guess.state[YAW] == 0.0)
    assert straight.state[Y] == pytest.approx(0.328 - 0.038 + 0.03)


def test_a_block_far_from_where_its_face_should_be_is_left_out() -> None:
    found = new_filter()
    look(found, state_of())
    (target,) = blocks_of(state_of())
    stranger = Block(Face.TARGET, 290, 190, 30, 30, index=9)
    assert found.plausible([stranger, target]) == [target]


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.3, 0.3), st.floats(0.2, 0.5), st.floats(-3.0, 3.0))
def test_the_relative_tilt_is_the_same_whichever_way_the_follower_turns(
    saddle: float, skew: float, x_m: float, y_m: float, turn_rad: float
) -> None:
    state = state_of(x_m, y_m)
    state[SADDLE], state[SKEW] = saddle, skew
    before = np.ravel(relative_tilt(state[None]))
    after = np.ravel(relative_tilt(after_motion(state, Motion(yaw_rad=turn_rad))[None]))
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    assert after == pytest.approx(np.array([[c, s], [-s, c]]) @ before, abs=1e-9)


def test_steps_with_a_high_nis_are_believed_less() -> None:
    calm, inflated = new_filter(), new_filter()
    for found, aside_m in ((calm, 0.0), (inflated, 0.02)):
        state = state_of()
        for number in range(6):
            look(found, state)
            found.neighbour_stepped(AHEAD, Drives(count=1))
            found.moved(Motion(0.05))
            state = state_of(y_m=FORMATION_DISTANCE_M + aside_m * (-1) ** number)
        look(found, state)
        found.neighbour_stepped(AHEAD, Drives(count=1))
    spread = [found.best.covariance[Y, Y] for found in (calm, inflated)]
    assert spread[1] > 2.0 * spread[0]
