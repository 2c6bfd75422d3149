"""A person's velocities as motions: held, clamped, stopped."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.driven_steps import DrivenSteps, Velocity, step_of
from robot_formation.leader.paths import Teleop

velocities = st.floats(-10.0, 10.0)


def test_a_velocity_is_held_over_the_timesteps_duration() -> None:
    driven = DrivenSteps(Teleop(duration_s=2.0))
    assert driven.command(Velocity(0.02, -0.01, 0.0), 10.0)
    assert driven.motion(10.4) == Motion(0.04, -0.02)


def test_nobody_drives_before_the_first_velocity_after_the_last_or_at_zero() -> None:
    driven = DrivenSteps(Teleop(timeout_s=0.5))
    assert driven.motion(0.0) is None
    driven.command(Velocity(0.02, 0.0, 0.0), 1.0)
    assert driven.motion(1.5) is not None
    assert driven.motion(1.51) is None
    driven.command(Velocity(0.0, 0.0, 0.0), 2.0)
    assert driven.motion(2.0) is None


def test_a_velocity_that_is_not_finite_is_not_taken() -> None:
    driven = DrivenSteps(Teleop())
    assert not driven.command(Velocity(math.nan, 0.0, 0.0), 1.0)
    assert not driven.command(Velocity(0.0, 0.0, math.inf), 1.0)
    assert driven.motion(1.0) is None


@given(velocities, velocities, velocities)
def test_motions_keep_the_bounds_whatever_is_asked_for(ahead: float, left: float, turn: float) -> None:
    parameters = Teleop()
    motion = step_of(Velocity(ahead, left, turn), parameters)
    assert abs(motion.yaw_rad) <= math.radians(parameters.max_turn_deg) + 1e-6
    reach = math.hypot(parameters.max_forward_m, parameters.max_sideways_m)
    assert math.hypot(motion.x_m, motion.y_m) <= reach + 1e-6


def test_ahead_with_a_turn_is_an_arc() -> None:
    motion = step_of(Velocity(0.05, 0.0, 0.1), Teleop())
    radius = 0.05 / 0.1
    assert motion.x_m == pytest.approx(radius * math.sin(0.1), abs=1e-6)
    assert motion.y_m == pytest.approx(radius * (1.0 - math.cos(0.1)), abs=1e-6)
    assert motion.yaw_rad == 0.1
