"""The gap of two footprints, against OpenCV's intersection of rotated rectangles."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.geometry.footprint import footprint_gap_m, footprint_gaps_m
from robot_formation.geometry.se2 import Motion

LENGTH_M, WIDTH_M = 0.365, 0.238
places = st.floats(-0.6, 0.6)
angles = st.floats(-math.pi, math.pi)


def overlap_m2(other: Motion) -> float:
    """Area that both rectangles cover, by OpenCV."""
    first = ((0.0, 0.0), (LENGTH_M, WIDTH_M), 0.0)
    second = ((other.x_m, other.y_m), (LENGTH_M, WIDTH_M), math.degrees(other.yaw_rad))
    _, corners = cv2.rotatedRectangleIntersection(first, second)
    return 0.0 if corners is None else cv2.contourArea(cv2.convexHull(corners))


@given(places, places, angles)
def test_footprints_overlap_just_where_the_gap_is_negative(x_m: float, y_m: float, yaw_rad: float) -> None:
    other = Motion(x_m, y_m, yaw_rad)
    gap_m = footprint_gap_m(other, LENGTH_M, WIDTH_M)
    if abs(gap_m) > 1e-3:  # nearer to touching, single-precision areas say nothing
        assert (overlap_m2(other) > 1e-8) == (gap_m < 0.0)


@given(places, places, angles)
def test_the_gap_is_the_same_from_both_sides(x_m: float, y_m: float, yaw_rad: float) -> None:
    other = Motion(x_m, y_m, yaw_rad)
    back = footprint_gap_m(other.inverse(), LENGTH_M, WIDTH_M)
    assert back == pytest.approx(footprint_gap_m(other, LENGTH_M, WIDTH_M), abs=1e-12)


def test_side_by_side_the_gap_is_the_distance_less_a_width() -> None:
    assert footprint_gap_m(Motion(0.0, 0.32), LENGTH_M, WIDTH_M) == pytest.approx(0.32 - WIDTH_M)
    assert footprint_gap_m(Motion(0.5, 0.0), LENGTH_M, WIDTH_M) == pytest.approx(0.5 - LENGTH_M)


@given(st.lists(st.tuples(places, places, angles, places, places, angles), min_size=1, max_size=5))
def test_gaps_of_many_pairs_are_those_of_each(pairs: list[tuple[float, ...]]) -> None:
    poses = np.array(pairs)
    found = footprint_gaps_m(poses[:, :3], poses[:, 3:], LENGTH_M, WIDTH_M)
    single = [footprint_gap_m(Motion(*pair[3:]).relative_to(Motion(*pair[:3])), LENGTH_M, WIDTH_M) for pair in pairs]
    assert found == pytest.approx(single, abs=1e-12)
