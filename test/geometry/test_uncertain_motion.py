"""Covariances of motions through compositions, against small differences and rotations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import (
    TURN_UNKNOWN,
    UncertainMotion,
    composition_jacobians,
    covariance_uv,
    covariance_xy,
)

lengths, angles = st.floats(-0.5, 0.5), st.floats(-1.5, 1.5)
motions = st.builds(Motion, lengths, lengths, angles)
sigmas = st.tuples(*(st.floats(0.0, 0.1),) * 3)


def numbers(motion: Motion) -> list[float]:
    return [motion.x_m, motion.y_m, motion.yaw_rad]


def uncertain(mean: Motion, found: tuple[float, float, float]) -> UncertainMotion:
    return UncertainMotion.of(mean, np.diag(np.square(found)))


@given(motions, motions)
def test_the_derivatives_of_a_composition_are_its_small_differences(first: Motion, second: Motion) -> None:
    step = 1e-6
    for number, jacobian in enumerate(composition_jacobians(first, second)):
        for column in range(3):
            ends = []
            for sign in (1.0, -1.0):
                pair = [numbers(first), numbers(second)]
                pair[number][column] += sign * step
                ends.append(numbers(Motion(*pair[0]).then(Motion(*pair[1]))))
            np.testing.assert_allclose(
                jacobian[:, column], (np.array(ends[0]) - ends[1]) / (2.0 * step), rtol=0, atol=1e-8
            )


@given(motions, sigmas)
def test_what_is_left_after_a_whole_motion_is_nothing_but_its_error(motion: Motion, found: tuple[float, ...]) -> None:
    left = uncertain(motion, (found[0], found[1], found[2])).after(motion)
    assert numbers(left.mean) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert np.linalg.eigvalsh(left.matrix[:2, :2]) == pytest.approx(sorted(np.square(found[:2])), abs=1e-12)
    assert left.matrix[2, 2] == pytest.approx(found[2] ** 2, abs=1e-15)


@given(motions, motions, sigmas)
def test_a_step_told_in_another_robots_frame_and_back_is_the_same(
    place: Motion, step: Motion, found: tuple[float, ...]
) -> None:
    told = uncertain(step, (found[0], found[1], found[2]))
    back = told.between(place, place.inverse()).between(place.inverse(), place)
    assert numbers(back.mean) == pytest.approx(numbers(step), abs=1e-9)
    np.testing.assert_allclose(back.matrix, told.matrix, rtol=0, atol=1e-9)


@given(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9))
def test_covariances_of_both_axes_conventions_come_back_the_same(values: list[float]) -> None:
    root = np.reshape(values, (3, 3))
    covariance = root @ root.T
    np.testing.assert_allclose(covariance_uv(covariance_xy(covariance)), covariance, rtol=0, atol=1e-12)


def test_u_is_minus_y_and_v_is_x_in_covariances_too() -> None:
    found = np.reshape(covariance_xy(np.array([[4.0, 1.0, 0.5], [1.0, 9.0, 0.25], [0.5, 0.25, 1.0]])), (3, 3))
    assert (found[0, 0], found[1, 1], found[0, 1]) == (9.0, 4.0, -1.0)
    assert (found[0, 2], found[1, 2]) == (0.25, -0.5)


def test_an_unknown_turn_is_told_from_an_exact_one() -> None:
    assert UncertainMotion(Motion()).turn_known
    assert not UncertainMotion(Motion(), TURN_UNKNOWN).turn_known
    assert not UncertainMotion(Motion(math.nan)).finite
