"""The marker model's projection against OpenCV's, and what it says of faces."""

import math

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.alignment.precise.marker_projection import GeometryParameters, MarkerModel, relative_tilt
from robot_formation.vision.marker import Face

Array = npt.NDArray[np.float64]

P = GeometryParameters()
MATRIX = np.array([[P.focal_length_px, 0.0, P.centre_x_px], [0.0, P.focal_length_px, P.centre_y_px], [0.0, 0.0, 1.0]])
# The camera looks to the left: its x is base_link's x, its y points down, its z along base_link's y.
TO_CAMERA = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def rotation(axis: tuple[float, float, float], angle: float) -> Array:
    return cv2.Rodrigues(np.array(axis) * angle)[0].astype(float)


def projected(state: Array) -> Array:
    """Pixels (8, 2) of the cube's corners by OpenCV: the neighbour tilted by half of the relative tilt, then all."""
    (roll,), (pitch,) = relative_tilt(state[None])
    half = rotation((0.0, 1.0, 0.0), pitch / 2.0) @ rotation((1.0, 0.0, 0.0), roll / 2.0)
    edge, top = P.marker_edge_m / 2.0, P.marker_top_m
    ground = ((-edge, -edge), (edge, -edge), (edge, edge), (-edge, edge))
    corners = np.array([(x, y, z) for x, y in ground for z in (top - 2.0 * edge, top)])
    turned = half @ rotation((0.0, 0.0, 1.0), state[2]) @ corners.T
    points = half @ (turned + np.array([[state[0]], [state[1]], [0.0]]))
    offset = -TO_CAMERA @ (0.0, P.lens_y_m, P.lens_z_m)
    pixels, _ = cv2.projectPoints(points.T.copy(), cv2.Rodrigues(TO_CAMERA)[0], offset, MATRIX, None)
    return pixels[:, 0].astype(float)


@given(
    st.floats(-0.25, 0.25),
    st.floats(0.25, 0.8),
    st.floats(-1.5, 1.5),
    st.floats(-0.3, 0.3),
    st.floats(-0.2, 0.2),
    st.floats(-0.2, 0.2),
)
def test_the_projection_is_that_of_opencv(
    x_m: float, y_m: float, yaw_rad: float, mean: float, saddle: float, skew: float
) -> None:
    state = np.array([x_m, y_m, yaw_rad, mean, saddle, skew])
    assert MarkerModel(P).pixels(state[None])[0] == pytest.approx(projected(state), abs=1e-6)


def test_in_formation_the_target_face_has_the_paper_s_size_and_the_other_faces_are_turned_away() -> None:
    widths = MarkerModel(P).widths(np.array([0.0, 0.32, 0.0, 0.0, 0.0, 0.0]))
    assert widths[Face.TARGET] == pytest.approx(P.focal_length_px * P.marker_edge_m / 0.328)
    assert widths[Face.FRONT] < 0.0
    assert widths[Face.REAR] < 0.0


@pytest.mark.parametrize(
    ("turn_deg", "shown", "hidden"), [(40.0, Face.REAR, Face.FRONT), (-40.0, Face.FRONT, Face.REAR)]
)
def test_a_neighbour_that_turns_shows_one_more_face(turn_deg: float, shown: Face, hidden: Face) -> None:
    widths = MarkerModel(P).widths(np.array([0.0, 0.4, math.radians(turn_deg), 0.0, 0.0, 0.0]))
    assert widths[shown] > 5.0
    assert widths[hidden] < 0.0
