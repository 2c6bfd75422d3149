"""Wheels, moves, displacements and poses."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from robot_formation.conversions.basics import stamped
from robot_formation.drive.movement_system import WheelCommand
from robot_formation.errors import MessageError
from robot_formation.geometry.se2 import Motion
from robot_formation.names import JOINTS, WHEELS
from robot_formation.system.cdr import HEAD, add_numbers, add_text, gap

_LARGEST_WHEEL_ANGLE_RAD = 1e4
_PLANAR = [6 * row + column for row in (0, 1, 5) for column in (0, 1, 5)]
"""Where the covariance of (x, y, yaw) lies in a pose's (6, 6), row by row."""
_PLACE = [6 * row + column for row in (0, 1) for column in (0, 1)]
"""Where that of (x, y) lies."""
_STAMP, _COUNT, _POSE, _TWIST = (struct.Struct(f"<{kind}") for kind in ("iI", "I", "7d", "6d"))
_NO_COVARIANCE = bytes(36 * 8)
_IDENTITY = (0.0, 0.0, 0.0, 1.0)
"""Orientation (x, y, z, w) of what is not turned."""


def joint_command(command: WheelCommand, stamp_ns: int) -> JointState:
    """Relative wheel angles [rad] as `position`, speed limits [rad/s] as `velocity`; `frame_id` numbers the command.

    `effort` is not used, but filled: rosbags can't read what some CDR writers put behind an empty last list.
    """
    return stamped(
        JointState,
        stamp_ns,
        command.number,
        name=list(WHEELS),
        position=list(command.angles_rad),
        velocity=list(command.limits_rad_s),
        effort=[0.0] * len(WHEELS),
    )


def read_joint_command(message: JointState) -> WheelCommand:
    """Read relative wheel angles and speed limits in any joint order."""
    if sorted(message.name) != sorted(WHEELS):
        raise MessageError(
            f"joint_commands must name {', '.join(WHEELS)} once each, not {', '.join(message.name) or 'nothing'}"
        )
    if len(message.position) != len(WHEELS) or len(message.velocity) != len(WHEELS):
        raise MessageError(
            f"joint_commands must have {len(WHEELS)} positions (rad) and {len(WHEELS)} velocities (rad/s)"
        )
    order = [list(message.name).index(name) for name in WHEELS]
    angles = tuple(float(message.position[i]) for i in order)
    limits = tuple(float(message.velocity[i]) for i in order)
    if not all(map(math.isfinite, angles + limits)):
        raise MessageError("joint_commands must be finite")
    if max(map(abs, angles)) > _LARGEST_WHEEL_ANGLE_RAD:
        raise MessageError(f"joint_commands are relative angles in rad; {max(map(abs, angles)):.3g} is absurd")
    return WheelCommand(angles, limits, message.header.frame_id)


def joint_states(
    names: Sequence[str], positions: Sequence[float], velocities: Sequence[float], stamp_ns: int, number: str = ""
) -> JointState:
    """Make the joints' report: positions [rad], velocities [rad/s]; `frame_id` is the number of the last command."""
    return stamped(
        JointState,
        stamp_ns,
        number,
        name=list(names),
        position=list(positions),
        velocity=list(velocities),
        effort=[0.0] * len(names),
    )


def read_joint_states(message: JointState) -> tuple[list[float], list[float]]:
    """Read positions [rad] and velocities [rad/s] in the order of `names.JOINTS`."""
    index = {name: i for i, name in enumerate(message.name)}
    missing = [name for name in JOINTS if name not in index]
    if missing or len(message.position) != len(index) or len(message.velocity) != len(index):
        raise MessageError(
            f"joint_states must have one position and one velocity of each joint ({', '.join(JOINTS)}); "
            f"missing: {', '.join(missing) or 'values'}"
        )
    positions = [float(message.position[index[name]]) for name in JOINTS]
    velocities = [float(message.velocity[index[name]]) for name in JOINTS]
    if not all(map(math.isfinite, positions + velocities)):
        raise MessageError("joint_states must be finite")
    return positions, velocities


def _set_planar(pose: Pose, motion: Motion) -> None:
    pose.position.x, pose.position.y = motion.x_m, motion.y_m
    pose.orientation.z, pose.orientation.w = math.sin(motion.yaw_rad / 2.0), math.cos(motion.yaw_rad / 2.0)


def move(motion: Motion, frame: str, stamp_ns: int) -> PoseStamped:
    """Make a move's target in the robot's `base_link`."""
    message = stamped(PoseStamped, stamp_ns, frame)
    _set_planar(message.pose, motion)
    return message


def read_pose(pose: Pose) -> Motion:
    """Read a planar displacement: x, y and yaw. Not-finite values are kept for the core to refuse."""
    o = pose.orientation
    # A quaternion of any length gives its yaw; atan2 would make a number of infinite components.
    yaw = math.atan2(2.0 * (o.w * o.z + o.x * o.y), o.w * o.w + o.x * o.x - o.y * o.y - o.z * o.z)
    if not all(map(math.isfinite, (o.x, o.y, o.z, o.w))):
        yaw = math.nan
    return Motion(float(pose.position.x), float(pose.position.y), yaw)


def read_move(message: PoseStamped) -> Motion:
    """Read a move's target."""
    return read_pose(message.pose)


def displacement(
    motion: Motion, frame: str, stamp_ns: int, covariance: Sequence[float] = (0.0,) * 9
) -> PoseWithCovarianceStamped:
    """Make a displacement with its covariance.

    Args:
        motion: the displacement.
        frame: whose it is in.
        stamp_ns: simulated time at which it is a fact.
        covariance: of (x, y, yaw), or only of (x, y), row by row [m^2, m rad, rad^2]; a negative variance of x says
            that there is no estimate, a negative one of yaw that the turn isn't known.
    """
    message = stamped(PoseWithCovarianceStamped, stamp_ns, frame)
    _set_planar(message.pose.pose, motion)
    full = np.zeros(36)
    full[_PLANAR if len(covariance) == 9 else _PLACE] = covariance
    message.pose.covariance = full
    return message


NO_ESTIMATE = (-1.0, *(0.0,) * 8)


def read_displacement(message: PoseWithCovarianceStamped) -> Motion:
    """Read a displacement's mean."""
    return read_pose(message.pose.pose)


def read_covariance(message: PoseWithCovarianceStamped) -> tuple[float, ...]:
    """Read the covariance of (x, y, yaw), row by row [m^2, m rad, rad^2]."""
    covariance = message.pose.covariance
    return tuple(float(covariance[index]) for index in _PLANAR)


def has_estimate(message: PoseWithCovarianceStamped) -> bool:
    """Return whether a displacement was estimated at all."""
    return float(message.pose.covariance[0]) >= 0.0


def knows_turn(message: PoseWithCovarianceStamped) -> bool:
    """Return whether a displacement's turn was estimated."""
    return has_estimate(message) and float(message.pose.covariance[35]) >= 0.0


def read_planar_twist(twist: Twist) -> tuple[float, float, float]:
    """Read a velocity: ahead and to the left [m/s], anticlockwise [rad/s]; not-finite values are kept."""
    return float(twist.linear.x), float(twist.linear.y), float(twist.angular.z)


def odometry(motion: Motion, frame: str, child: str, stamp_ns: int) -> Odometry:
    """Make planar odometry."""
    message = stamped(Odometry, stamp_ns, frame, child_frame_id=child)
    _set_planar(message.pose.pose, motion)
    return message


def body_odometry(
    position: Sequence[float],
    quaternion_xyzw: Sequence[float],
    linear: Sequence[float],
    angular: Sequence[float],
    *,
    frame: str,
    child: str,
    stamp_ns: int,
) -> bytes:
    """Make an Odometry message, serialised: a full pose in `frame`, and velocities in the child frame (nav_msgs).

    A run has hundreds, mostly for a recorder alone; by way of rclpy's classes each costs ten times as much.
    """
    stamp = _STAMP.pack(*divmod(stamp_ns, 10**9))
    pose = _POSE.pack(*position, *quaternion_xyzw)
    twist = _TWIST.pack(*linear, *angular)
    return b"".join((HEAD, stamp, _frames(frame, child), pose, _NO_COVARIANCE, twist, _NO_COVARIANCE))


@lru_cache(maxsize=64)
def _frames(frame: str, child: str) -> bytes:
    """What a serialised Odometry has between stamp and pose."""
    cdr = bytearray(HEAD + bytes(_STAMP.size))
    before = len(cdr)
    add_text(cdr, frame)
    add_text(cdr, child)
    return bytes(cdr[before:]) + bytes(gap(len(cdr), 8))


def pose(position: Sequence[float], quaternion_xyzw: Sequence[float], frame: str, stamp_ns: int) -> PoseStamped:
    """Make a full pose."""
    message = place(position, frame, stamp_ns)
    o = message.pose.orientation
    o.x, o.y, o.z, o.w = map(float, quaternion_xyzw)
    return message


def place(position: Sequence[float], frame: str, stamp_ns: int) -> PoseStamped:
    """Make a pose of which only the place (x, y, z) is known: its orientation is the frame's."""
    message = stamped(PoseStamped, stamp_ns, frame)
    p = message.pose.position
    p.x, p.y, p.z = map(float, position)
    return message


def pose_array(poses: Sequence[PoseStamped], frame: str, stamp_ns: int) -> PoseArray:
    """Make one message of several poses."""
    return stamped(PoseArray, stamp_ns, frame, poses=[each.pose for each in poses])


class PathPose(NamedTuple):
    """A pose of a path, serialised: its time and frame, and its seven numbers."""

    head: bytes
    numbers: bytes


def path_pose(
    position: Sequence[float], frame: str, stamp_ns: int, quaternion_xyzw: Sequence[float] = _IDENTITY
) -> PathPose:
    """Make a pose of a path."""
    cdr = bytearray(HEAD + _STAMP.pack(*divmod(stamp_ns, 10**9)))
    add_text(cdr, frame)
    return PathPose(bytes(cdr[len(HEAD) :]), _POSE.pack(*position, *quaternion_xyzw))


def planar_path_pose(motion: Motion, frame: str, stamp_ns: int) -> PathPose:
    """Make a pose of a path in a plane."""
    turn = (0.0, 0.0, math.sin(motion.yaw_rad / 2.0), math.cos(motion.yaw_rad / 2.0))
    return path_pose((motion.x_m, motion.y_m, 0.0), frame, stamp_ns, turn)


def path(poses: Sequence[PathPose], frame: str, stamp_ns: int) -> bytes:
    """Make a Path message, serialised.

    A path that grows is sent again and again. By way of rclpy's classes each of its poses would be serialised anew.
    """
    cdr = bytearray(HEAD + _STAMP.pack(*divmod(stamp_ns, 10**9)))
    add_text(cdr, frame)
    add_numbers(cdr, 4, _COUNT.pack(len(poses)))
    for pose in poses:
        add_numbers(cdr, 4, pose.head)
        add_numbers(cdr, 8, pose.numbers)
    return bytes(cdr)
