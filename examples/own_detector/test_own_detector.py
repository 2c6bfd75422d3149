"""The package's own tests."""

import numpy as np
from own_detector.detector import find_faces
from own_detector.predictor import Smoothed

from robot_formation.testing import check_predictor


def test_a_green_square_is_the_front_face():
    picture = np.full((208, 316, 3), 128, np.uint8)
    picture[60:101, 100:141] = (0, 200, 0)
    assert find_faces(picture) == [(2, 120, 80, 40, 40)]


def test_grey_is_no_face():
    assert find_faces(np.full((208, 316, 3), 128, np.uint8)) == []


def test_the_predictor_is_what_robot_formation_asks_for():
    check_predictor(Smoothed)
