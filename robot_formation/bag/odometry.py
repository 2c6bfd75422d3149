"""Odometry of one topic of a bag, of which a long run has tens of thousands: poses of all at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from robot_formation.bag.definitions import jazzy_typestore
from robot_formation.names import Message

ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
_HEAD = 4  # of a CDR message: what follows is aligned from here on
_LITTLE_ENDIAN = 1
_POSE_NUMBERS = 7  # x, y, z of the place, x, y, z, w of the orientation
_FARTHEST_M = 1e6
_MOST_OFF_UNIT = 1e-3  # length of a quaternion


class Odometry(Sequence[Message]):
    """The messages of a topic, decoded one by one when they are asked for.

    Messages whose pose is none are left out: see `are_poses`.

    Attributes:
        stamps_ns: (n,) nanoseconds, as the messages tell.
        positions_m: (n, 3) x, y, z.
        orientations: (n, 4) x, y, z, w.

    Args:
        cdr: serialised messages, at least one.
    """

    def __init__(self, cdr: Sequence[bytes]) -> None:
        columns = _columns(cdr)
        if columns is None:
            messages = [_decoded(message) for message in cdr]
            poses = [message.pose.pose for message in messages]
            stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in messages]
            places = [(p.position.x, p.position.y, p.position.z) for p in poses]
            turns = [(p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w) for p in poses]
            columns = np.array(stamps, dtype=np.int64), np.hstack([np.array(places), np.array(turns)])
        stamps_of, poses_of = columns
        kept = are_poses(poses_of[:, :3], poses_of[:, 3:])
        self._cdr = [cdr[index] for index in np.flatnonzero(kept).tolist()]
        self.stamps_ns = stamps_of[kept]
        self.positions_m, self.orientations = poses_of[kept, :3], poses_of[kept, 3:]

    def __len__(self) -> int:
        return len(self._cdr)

    @overload
    def __getitem__(self, index: int) -> Message: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Message]: ...

    def __getitem__(self, index: int | slice) -> Message | Sequence[Message]:
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(len(self)))]
        return _decoded(self._cdr[index])


def are_poses(positions_m: NDArray[np.float64], orientations: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of some poses, (n, 3) and (n, 4), are poses: finite places near the world, unit quaternions."""
    with np.errstate(over="ignore", invalid="ignore"):  # any numbers
        near = (np.abs(positions_m) < _FARTHEST_M).all(axis=1)
        unit = np.abs(np.linalg.norm(orientations, axis=1) - 1.0) < _MOST_OFF_UNIT
    return np.asarray(near & unit)


def _decoded(cdr: bytes) -> Message:
    return jazzy_typestore().deserialize_cdr(cdr, ODOMETRY_TYPE)


def _columns(cdr: Sequence[bytes]) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Read stamps (n,) and poses (n, 7) of messages that have the same frames; None if they differ in anything else."""
    if len({len(message) for message in cdr}) != 1 or cdr[0][:2] != bytes([0, _LITTLE_ENDIAN]):
        return None
    table = np.frombuffer(b"".join(cdr), np.uint8).reshape(len(cdr), -1)
    begin = end = _HEAD + 8  # sec and nanosec come first, then both frames
    for _ in range(2):
        start = _aligned(end, 4)  # bytes that align hold anything
        end = start + 4 + int.from_bytes(cdr[0][start : start + 4], "little")
        if end > table.shape[1] or (table[:, start:end] != table[0, start:end]).any():
            return None
    first = _aligned(end, 8)
    last = first + 8 * _POSE_NUMBERS
    if last > table.shape[1] or (table[:, 1] != _LITTLE_ENDIAN).any():
        return None
    stamps = table[:, _HEAD:begin].copy().view("<u4").astype(np.int64)
    seconds = stamps[:, 0].astype(np.int32).astype(np.int64)  # signed, as the message has it
    return seconds * 10**9 + stamps[:, 1], table[:, first:last].copy().view("<f8").astype(float)


def _aligned(place: int, size: int) -> int:
    return place + -(place - _HEAD) % size
