"""Odometry of one topic of a bag, of which a long run has tens of thousands: poses of all at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_formation.bag.definitions import jazzy_typestore
from robot_formation.bag.errors import BagError
from robot_formation.system.cdr import HEAD, gap

ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
_TIME = 8  # sec and nanosec, which come first
_LITTLE_ENDIAN = 1
_POSE_NUMBERS = 7  # x, y, z of the place, x, y, z, w of the orientation
_READ_AT_ONCE = 4096
_FARTHEST_M = 1e6
_MOST_OFF_UNIT = 1e-3  # length of a quaternion


class Odometry:
    """Stamps and poses of a topic's messages. The messages themselves, 700 bytes each, are not kept.

    Messages whose pose is none are left out: see `are_poses`.

    Args:
        where: the bag's path and the topic, for what is said of a message that can't be read.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._unread: list[bytes] = []
        self._parts = [(np.empty(0, np.int64), np.empty((0, _POSE_NUMBERS)))]

    def add(self, cdr: bytes) -> None:
        """Take a serialised message; it may be read later, together with others, and refused then.

        Raises:
            BagError: a message can't be read.
        """
        self._unread.append(cdr)
        if len(self._unread) >= _READ_AT_ONCE:
            self._read()

    def poses(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Return stamps (n,) in nanoseconds, places (n, 3) x, y, z, and orientations (n, 4) x, y, z, w.

        Raises:
            BagError: a message can't be read.
        """
        if self._unread:
            self._read()
        stamps, poses = (np.concatenate(parts) for parts in zip(*self._parts, strict=True))
        return stamps, poses[:, :3], poses[:, 3:]

    def _read(self) -> None:
        cdr, self._unread = self._unread, []
        try:
            stamps, poses = _columns(cdr) or _decoded(cdr)
        except Exception as error:  # rosbags' decoders have no common error
            reason = " ".join(str(error).split()) or type(error).__name__
            raise BagError(f"{self._where} holds a message that can't be read: {reason}") from error
        kept = are_poses(poses[:, :3], poses[:, 3:])
        self._parts.append((stamps[kept], poses[kept]))


def are_poses(positions_m: NDArray[np.float64], orientations: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of some poses, (n, 3) and (n, 4), are poses: finite places near the world, unit quaternions."""
    with np.errstate(over="ignore", invalid="ignore"):  # any numbers
        near = (np.abs(positions_m) < _FARTHEST_M).all(axis=1)
        unit = np.abs(np.linalg.norm(orientations, axis=1) - 1.0) < _MOST_OFF_UNIT
    return np.asarray(near & unit)


def _decoded(cdr: Sequence[bytes]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read stamps (n,) and poses (n, 7) of any messages, one by one."""
    messages = [jazzy_typestore().deserialize_cdr(message, ODOMETRY_TYPE) for message in cdr]
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in messages]
    places = [m.pose.pose.position for m in messages]
    turns = [m.pose.pose.orientation for m in messages]
    poses = [(p.x, p.y, p.z, o.x, o.y, o.z, o.w) for p, o in zip(places, turns, strict=True)]
    return np.array(stamps, dtype=np.int64), np.array(poses)


class Layout(NamedTuple):
    """Where a serialised message has its time, its two frames (with their lengths) and its pose."""

    time: slice
    frames: tuple[slice, slice]
    pose: slice


def layout(cdr: bytes) -> Layout | None:
    """Find the parts of a message; None if it is too short or has another byte order."""
    if cdr[:2] != HEAD[:2]:
        return None
    frames, end = [], len(HEAD) + _TIME
    for _ in range(2):
        start = end + gap(end, 4)  # bytes that align hold anything
        end = start + 4 + int.from_bytes(cdr[start : start + 4], "little")
        frames.append(slice(start, end))
    first = end + gap(end, 8)
    last = first + 8 * _POSE_NUMBERS
    if last > len(cdr):
        return None
    return Layout(slice(len(HEAD), len(HEAD) + _TIME), (frames[0], frames[1]), slice(first, last))


def _columns(cdr: Sequence[bytes]) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Read stamps (n,) and poses (n, 7) of messages that have the same frames; None if they differ in anything else."""
    places = layout(cdr[0])
    if places is None or len({len(message) for message in cdr}) != 1:
        return None
    table = np.frombuffer(b"".join(cdr), np.uint8).reshape(len(cdr), -1)
    if any((table[:, frame] != table[0, frame]).any() for frame in places.frames):
        return None
    if (table[:, 1] != _LITTLE_ENDIAN).any():
        return None
    stamps = table[:, places.time].copy().view("<u4").astype(np.int64)
    seconds = stamps[:, 0].astype(np.int32).astype(np.int64)  # signed, as the message has it
    return seconds * 10**9 + stamps[:, 1], table[:, places.pose].copy().view("<f8").astype(float)
