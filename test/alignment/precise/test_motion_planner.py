"""The next correction: direct where it keeps clear, else the best of a set of legs."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alignment_helpers import state_of
from robot_formation.alignment.precise.marker_projection import Vector, after_motion, pose_of
from robot_formation.alignment.precise.motion_planner import MotionPlanner, PlannerParameters, count_legs
from robot_formation.geometry.footprint import footprint_gap_m
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M, Motion

P = PlannerParameters()
PLANNER = MotionPlanner(P)
FORMATION = Motion(y_m=-FORMATION_DISTANCE_M)


def gap_m(state: Vector) -> float:
    return footprint_gap_m(pose_of(state), P.body_length_m, P.body_width_m)


def gaps_on_the_way(state: Vector, motion: Motion) -> list[float]:
    """Gaps between the bodies along a motion's legs, every twentieth of a leg."""
    found = []
    for turn, forward, left in np.diag(motion.legs):
        for share in np.linspace(0.0, 1.0, 21):
            found.append(gap_m(after_motion(state, Motion.from_legs(share * turn, share * forward, share * left))))
        state = after_motion(state, Motion.from_legs(turn, forward, left))
    return found


def test_a_free_way_within_the_drives_range_is_made_in_one_move() -> None:
    way = Motion(0.1, -0.05, 0.1)
    motion = PLANNER.next([after_motion(state_of(), way.inverse())], FORMATION)
    assert (motion.x_m, motion.y_m, motion.yaw_rad) == pytest.approx((way.x_m, way.y_m, way.yaw_rad))


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.4, 0.4), st.floats(0.25, 0.7), st.floats(-1.0, 1.0))
def test_no_planned_move_brings_the_bodies_together(x_m: float, y_m: float, yaw_rad: float) -> None:
    state = state_of(x_m, y_m, yaw_rad)
    if not PLANNER.apart(state):
        return
    motion = PLANNER.next([state], FORMATION)
    # Between the points that the planner looks at, a corner may come up to a millimetre or two nearer.
    assert min(gaps_on_the_way(state, motion)) > P.clearance_m - 0.003
    assert PLANNER.apart(after_motion(state, motion))


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(0.35, 0.7), st.floats(-0.6, 0.6))
def test_moves_that_follow_each_other_end_in_formation(x_m: float, y_m: float, yaw_rad: float) -> None:
    state, moves = state_of(x_m, y_m, yaw_rad), 0
    if not PLANNER.apart(state):
        return
    while (motion := PLANNER.next([state], FORMATION)) != Motion() and moves < 12:
        state, moves = after_motion(state, motion), moves + 1
        if math.hypot(*pose_of(state).then(FORMATION).legs) < 1e-6:
            break
    assert math.hypot(*pose_of(state).then(FORMATION).legs) < 1e-6


def test_a_move_keeps_clear_wherever_the_neighbour_may_stand() -> None:
    likely, other = state_of(0.0, 0.40), state_of(0.0, 0.32, 0.3)
    alone, careful = PLANNER.next([likely], FORMATION), PLANNER.next([likely, other], FORMATION)
    assert gap_m(after_motion(other, alone)) < P.clearance_m
    assert min(gaps_on_the_way(other, careful)) > P.clearance_m - 0.003


def test_no_candidate_leaves_the_ranges_of_the_drive() -> None:
    for x_m, y_m, yaw_rad in [(0.9, 0.7, 0.0), (-0.6, 1.0, 1.4), (0.2, 0.27, -1.5)]:
        turn, forward, left = PLANNER.next([state_of(x_m, y_m, yaw_rad)], FORMATION).legs
        assert abs(turn) <= P.max_turn_rad
        assert abs(forward) <= P.max_v_m
        assert abs(left) <= P.max_u_m


@pytest.mark.parametrize(("x_m", "sign"), [(0.3, -1.0), (-0.3, 1.0)])
def test_a_follower_turns_towards_its_neighbour(x_m: float, sign: float) -> None:
    state = state_of(x_m, 0.5)
    turned = after_motion(state, PLANNER.face([state]))
    assert turned[0] == pytest.approx(0.0, abs=1e-9)
    assert PLANNER.face([state]).yaw_rad * sign > 0.0


def test_where_a_turn_would_touch_it_turns_less_or_steps_away() -> None:
    near = state_of(0.16, 0.27)
    motion = PLANNER.face([near])
    assert 0.0 < -motion.yaw_rad < math.atan2(0.16, 0.27)
    assert min(gaps_on_the_way(near, motion)) > P.clearance_m - 0.003
    squeezed = state_of(0.16, 0.263)
    assert PLANNER.face([squeezed]).yaw_rad == 0.0
    assert gap_m(after_motion(squeezed, PLANNER.face([squeezed]))) > gap_m(squeezed)


def test_too_close_it_steps_away_and_not_into_its_neighbour() -> None:
    close = state_of(0.0, 0.25)
    assert not PLANNER.apart(close)
    assert gap_m(after_motion(close, PLANNER.away([close]))) > gap_m(close)
    assert PLANNER.away([state_of(0.0, -0.26)]) == Motion()  # the neighbour is on the other side


@pytest.mark.parametrize(
    ("way", "moves"),
    [(Motion(), 0), (Motion(0.2), 1), (Motion(0.21), 2), (Motion(0.2, 0.1), 2), (Motion(0.0, 0.25, 0.0), 3)],
)
def test_the_least_number_of_moves_counts_axes_apart(way: Motion, moves: int) -> None:
    assert PLANNER.moves(way) == moves


def test_legs_are_counted_after_the_turn() -> None:
    assert count_legs(Motion()) == 0
    assert count_legs(Motion.from_legs(0.3, 0.1, 0.0)) == 2
    assert count_legs(Motion(0.1, 0.1, 0.3)) == 3
