"""The package's own checks."""

from own_classes import Damped, Dunes, Hsv, Zigzag

from robot_formation.testing import check_path, check_predictor, check_sensor, check_surface


def test_classes_are_what_robot_formation_asks_for() -> None:
    check_predictor(Damped)
    check_surface(Dunes)
    check_path(Zigzag)
    check_sensor(Hsv)
