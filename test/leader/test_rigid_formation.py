"""Where the robots of a rigid formation are."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import leader_places, slot
from robot_formation.leader.paths import Given, make_path, poses
from robot_formation.leader.rigid_formation import (
    MARGIN_M,
    Formation,
    around,
    centred_start,
    follower_step,
    room_around,
    track_of,
)

FORMATION = Formation(leader_places([slot(0.32)] * 2), length_m=0.365, width_m=0.238)
STAGGERED = [slot(0.32, -0.05), slot(0.4, 0.1)]
part = st.floats(-0.2, 0.2)


@given(part, part, part, st.integers(0, 3), part)
def test_a_follower_that_makes_its_step_keeps_its_place(
    x: float, y: float, yaw: float, number: int, ahead: float
) -> None:
    step = Motion(x, y, yaw)
    place = slot(0.32 * number, ahead)
    kept = place.then(follower_step(step, place)).relative_to(step)
    assert (kept.x_m, kept.y_m, kept.yaw_rad) == pytest.approx((place.x_m, place.y_m, 0.0), abs=1e-12)


def test_a_straight_step_is_the_same_for_all_to_the_last_bit() -> None:
    assert follower_step(Motion(0.05), slot(0.96)) == Motion(0.05)


def test_the_lever_arm_makes_the_outer_follower_step_farther() -> None:
    step = follower_step(Motion(0.05, 0.0, 0.1), slot(0.32))
    assert step.v_m == pytest.approx(0.05 + 0.32 * math.sin(0.1))
    assert step.u_m == pytest.approx(-0.32 * (1.0 - math.cos(0.1)))


@pytest.mark.parametrize("places", [FORMATION.places, leader_places(STAGGERED)])
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-4.0, 4.0))
def test_a_box_holds_the_corners_of_all_bodies_and_no_more(
    places: Sequence[Motion], x: float, y: float, yaw: float
) -> None:
    corners = []
    for place in places:
        robot = Motion(x, y, yaw).then(place)
        for along in (-0.1825, 0.1825):
            corners += [robot.then(Motion(along, across)) for across in (-0.119, 0.119)]
    xs, ys = [c.x_m for c in corners], [c.y_m for c in corners]
    (box,) = Formation(places, 0.365, 0.238).boxes(np.array([(x, y, yaw)]))
    assert list(box) == pytest.approx([min(xs), max(xs), min(ys), max(ys)], abs=1e-9)


@pytest.mark.parametrize("name", ["circle", "lemniscate", "stadium"])
def test_a_centred_start_leaves_as_much_room_on_both_sides(name: str) -> None:
    path = make_path(name, [], Given(seed=3))
    swept = around(FORMATION.boxes(track_of(path, 60, Motion(yaw_rad=1.0))))[-1]
    x, y = centred_start(swept, 3.0)
    low_x, high_x, low_y, high_y = around(FORMATION.boxes(track_of(path, 60, Motion(x, y, 1.0))))[-1]
    assert (low_x, low_y) == pytest.approx((3.0 - high_x, 3.0 - high_y))


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 180.0, -90.0, 30.0, 135.0])
def test_a_leader_at_any_corner_of_its_room_has_all_bodies_on_the_plate(heading_deg: float) -> None:
    start = Motion(1.5, 1.4, math.radians(heading_deg))
    room = room_around(FORMATION, start, 3.0)
    reached = []
    for ahead in (room.ahead_m, -room.behind_m):
        for left in (room.left_m, -room.right_m):
            corner = start.then(Motion(ahead, left))
            reached.append(FORMATION.boxes(np.array([(corner.x_m, corner.y_m, corner.yaw_rad)]))[0])
    margins = [min(box[0], box[2], 3.0 - box[1], 3.0 - box[3]) for box in reached]
    assert min(margins) >= MARGIN_M - 1e-9
    assert min(margins) == pytest.approx(MARGIN_M) or heading_deg % 90.0


def test_a_walk_in_the_room_that_it_was_given_stays_on_the_plate() -> None:
    start = Motion(0.9, 0.8, 0.5 * math.pi)
    one = Formation(leader_places([slot(0.32)]), 0.365, 0.238)
    path = make_path("random_walk", [], Given(seed=8, room=room_around(one, start, 1.78)))
    boxes = one.boxes(track_of(path, 300, start))
    assert boxes.min() >= MARGIN_M - 1e-9
    assert boxes.max() <= 1.78 - MARGIN_M + 1e-9
    assert len(poses(path, 300)) == 301
