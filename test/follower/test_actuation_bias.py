"""What moves to a delayed place are asked for less."""

import math

import numpy as np
import pytest

from robot_formation.follower.actuation_bias import ActuationBias
from robot_formation.geometry.se2 import Motion


def gains(overshoot: float, learns: bool, timesteps: int = 400) -> float:
    """Amplification of a neighbour's alternating steps by a follower that drives what is left, too far by a share."""
    bias = ActuationBias()
    left, moved = 0.0, []
    steps = [0.05 + 0.01 * (-1) ** t for t in range(timesteps)]
    for step in steps:
        commanded = bias.taken_off(Motion(left)) if learns else Motion(left)
        way = (1.0 + overshoot) * commanded.x_m
        if learns:
            bias.learn(commanded, Motion(way - commanded.x_m))
        left += step - way
        moved.append(way)
    tail = slice(timesteps // 2, None)
    return float(np.ptp(moved[tail]) / np.ptp(steps[tail]))


def test_without_it_an_overshoot_amplifies_by_the_transfer_function() -> None:
    for overshoot in (0.05, 0.1, 0.3):
        assert gains(overshoot, learns=False) == pytest.approx((1.0 + overshoot) / (1.0 - overshoot), rel=1e-9)


def test_a_constant_bias_is_taken_off_to_the_end() -> None:
    bias = ActuationBias()
    for _ in range(60):
        commanded = bias.taken_off(Motion(0.05, 0.01, 0.02))
        bias.learn(commanded, Motion(0.004, -0.003))
    commanded = bias.taken_off(Motion(0.05, 0.01, 0.02))
    assert (commanded.x_m, commanded.y_m, commanded.yaw_rad) == pytest.approx((0.046, 0.013, 0.02), abs=1e-6)


def test_the_first_move_counts_half() -> None:
    bias = ActuationBias()
    assert bias.taken_off(Motion(0.05)) == Motion(0.05)
    bias.learn(Motion(0.05), Motion(0.004))
    assert bias.taken_off(Motion(0.05)).x_m == pytest.approx(0.048)


def test_moves_of_millimetres_neither_teach_nor_change() -> None:
    bias = ActuationBias()
    bias.learn(Motion(0.005), Motion(-0.004))
    assert bias.taken_off(Motion(0.05)) == Motion(0.05)
    bias.learn(Motion(0.05), Motion(0.004))
    assert bias.taken_off(Motion(0.015)) == Motion(0.015)
    assert math.isclose(bias.taken_off(Motion(0.0, 0.03)).x_m, -0.002)
