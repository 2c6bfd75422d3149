"""Poses between the recorded ones."""

import math
from typing import Any

import numpy as np
import pytest

from robot_formation.bag.odometry import ODOMETRY_TYPE, Odometry
from robot_formation.geometry.orientation import quaternion
from robot_formation.viewing.true_poses import TruePoses
from synthetic_bag import STORE, odometry

PERIOD_NS = 50_000_000


@pytest.fixture
def poses() -> TruePoses:
    """A robot that stands until 1 s, and then goes 2 cm and turns by 0.2 rad in 50 ms; told in the wrong order."""
    told = [(1_000_000_000, 1.00, 0.1), (0, 1.0, 0.1), (1_050_000_000, 1.02, 0.3), (3_000_000_000, 1.04, 0.3)]
    return true_poses([odometry(stamp_ns, x, 0.5, yaw, z=2.0 * x) for stamp_ns, x, yaw in told])


def true_poses(messages: list[Any]) -> TruePoses:
    read = Odometry("")
    for message in messages:
        read.add(bytes(STORE.serialize_cdr(message, ODOMETRY_TYPE)))
    return TruePoses(*read.poses(), period_ns=PERIOD_NS)


@pytest.mark.parametrize(
    ("stamp_ns", "x_m", "yaw"),
    [
        (-5, 1.0, 0.1),
        (999_999_999, 1.0, 0.1),
        (1_000_000_000, 1.0, 0.1),
        (1_025_000_000, 1.01, 0.2),
        (1_050_000_000, 1.02, 0.3),
        (2_990_000_000, 1.02, 0.3),  # a motion has begun, but how far it went is not known
        (3_000_000_000, 1.04, 0.3),
        (9_000_000_000, 1.04, 0.3),
    ],
)
def test_between_poses_of_a_motion_lies_the_line(poses: TruePoses, stamp_ns: int, x_m: float, yaw: float) -> None:
    pose = poses.at(stamp_ns)
    assert pose.position == pytest.approx((x_m, 0.5, 2.0 * x_m))
    assert pose.yaw_rad == pytest.approx(yaw, abs=1e-9)
    assert math.hypot(*pose.orientation) == pytest.approx(1.0)


def test_recorded_poses_come_back_to_the_last_bit(poses: TruePoses) -> None:
    for stamp_ns, position, orientation in zip(
        poses.stamps_ns.tolist(), poses.positions_m, poses.orientations, strict=True
    ):
        assert poses.at(stamp_ns).position == tuple(position)
        assert poses.at(stamp_ns).orientation == tuple(orientation)


def test_opposite_quaternions_are_the_same_orientation() -> None:
    messages = [odometry(0, 0.0, 0.0, 0.1), odometry(PERIOD_NS, 0.0, 0.0, 0.3)]
    turned = messages[1].pose.pose.orientation
    turned.z, turned.w = -turned.z, -turned.w
    half = true_poses(messages).at(PERIOD_NS // 2).orientation
    assert np.allclose(half, quaternion(0.0, 0.0, 0.2))


def test_what_is_no_pose_is_left_out() -> None:
    messages = [odometry(stamp_ns, x, 0.0, 0.1) for stamp_ns, x in ((0, 1.0), (1, math.nan), (2, math.inf), (3, 2.0))]
    turned = messages[3].pose.pose.orientation
    turned.z = turned.w = 0.0
    poses = true_poses(messages)
    assert poses.stamps_ns.tolist() == [0]
    assert poses.at(3).position == (1.0, 0.0, 0.0)
