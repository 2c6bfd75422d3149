"""Planar motions compose like rigid transforms, and u and v mean what the paper means."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.geometry.se2 import Motion, formation_error_uv_m
from robot_formation.geometry.slots import slot

lengths = st.floats(-10.0, 10.0)
angles = st.floats(-2 * math.pi, 2 * math.pi)
motions = st.builds(Motion, lengths, lengths, angles)


def matrix(motion: Motion) -> npt.NDArray[np.float64]:
    """The homogeneous transform of a motion, 3 x 3."""
    c, s = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
    return np.array([[c, -s, motion.x_m], [s, c, motion.y_m], [0.0, 0.0, 1.0]])


@given(first=motions, second=motions)
def test_composition_is_the_product_of_homogeneous_matrices(first: Motion, second: Motion) -> None:
    assert matrix(first.then(second)) == pytest.approx(matrix(first) @ matrix(second), abs=1e-12)


@given(motion=motions)
def test_standing_still_before_or_after_changes_nothing(motion: Motion) -> None:
    assert Motion().then(motion) == motion
    assert motion.then(Motion()) == motion


@given(a=motions, b=motions, c=motions)
def test_composition_is_associative(a: Motion, b: Motion, c: Motion) -> None:
    assert matrix(a.then(b).then(c)) == pytest.approx(matrix(a.then(b.then(c))), abs=1e-11)


def test_a_square_driven_with_left_turns_comes_back_to_its_start() -> None:
    side = Motion(1.0, 0.0, math.pi / 2)
    assert matrix(side.then(side).then(side).then(side)) == pytest.approx(np.eye(3), abs=1e-12)


def test_v_is_forward_and_u_is_to_the_right() -> None:
    assert Motion.from_uv(u_m=0.02, v_m=0.05) == Motion(x_m=0.05, y_m=-0.02)


@given(u=lengths, v=lengths)
def test_u_and_v_come_back_unchanged(u: float, v: float) -> None:
    motion = Motion.from_uv(u, v)
    assert (motion.u_m, motion.v_m, motion.yaw_rad) == (u, v, 0.0)


@given(motion=motions)
def test_x_and_y_come_back_from_u_and_v(motion: Motion) -> None:
    back = Motion.from_uv(motion.u_m, motion.v_m)
    assert (back.x_m, back.y_m) == (motion.x_m, motion.y_m)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("component", ["x_m", "y_m", "yaw_rad"])
def test_one_component_that_is_not_finite_makes_the_motion_not_finite(component: str, bad: float) -> None:
    assert Motion().finite
    assert not Motion(**{component: bad}).finite


@given(motion=motions)
def test_the_inverse_leads_back(motion: Motion) -> None:
    assert matrix(motion.then(motion.inverse())) == pytest.approx(np.eye(3), abs=1e-12)


@given(pose=motions, frame=motions)
def test_a_pose_in_a_frame_composes_back_to_itself(pose: Motion, frame: Motion) -> None:
    assert matrix(frame.then(pose.relative_to(frame))) == pytest.approx(matrix(pose), abs=1e-11)


@given(motion=motions)
def test_legs_driven_one_after_the_other_make_the_motion(motion: Motion) -> None:
    turn_rad, forward_m, left_m = motion.legs
    driven = Motion(yaw_rad=turn_rad).then(Motion(x_m=forward_m)).then(Motion(y_m=left_m))
    assert matrix(driven) == pytest.approx(matrix(motion), abs=1e-11)
    assert matrix(Motion.from_legs(*motion.legs)) == pytest.approx(matrix(motion), abs=1e-11)


@given(neighbour=motions, u=st.floats(-0.1, 0.1), v=st.floats(-0.1, 0.1), yaw=angles, ahead=st.floats(-0.2, 0.2))
def test_formation_error_does_not_depend_on_where_the_formation_stands(
    neighbour: Motion, u: float, v: float, yaw: float, ahead: float
) -> None:
    follower = neighbour.then(Motion(ahead + v, -0.32 - u, yaw))
    assert formation_error_uv_m(follower, neighbour, slot(0.32, ahead)) == pytest.approx((u, v), abs=1e-9)
