"""Where robots of a chain stand: poses at the end of timesteps, errors against the leader, and lag.

The leader's place of follower n is the sum of the slots up to its own, abreast n times the formation distance to the
leader's right; with delayed spacing where that was n timesteps ago, since each robot keeps its place beside where its
neighbour stood one timestep earlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robot_formation.analysis.run_record import FollowerRecord, RunRecord
from robot_formation.geometry.se2 import Motion, formation_error_uv_m
from robot_formation.json_values import JsonObject
from robot_formation.names import LEADER, beacon_neighbour, follower_number

_SAME = 1e-6
"""Sums of moves that differ by less than this are equal, metres and radians."""


def pose(record: RunRecord, robot: str, stamp_ns: int) -> Motion | None:
    """Return a robot's true pose at a stamp, if it is known."""
    track = record.tracks.get(robot)
    return track.at(stamp_ns) if track else None


def end_ns(record: RunRecord, robot: str, timestep: int) -> int | None:
    """Return the stamp of a timestep's end, if it is known; 0 and before: of the first alignment's.

    A follower ends with its report, the leader with its move.
    """
    track = record.tracks.get(robot)
    if track is None or not len(track.stamps_ns):
        return None
    follower = next((found for found in record.followers if found.name == robot), None)
    if timestep <= 0:
        moves = moves_of_timestep(record, follower, 1) if follower is not None and follower.displacements else []
        aligned = follower is not None and moves and moves[0] > 0
        return int(follower.moved[moves[0] - 1].stamp_ns if follower is not None and aligned else track.stamps_ns[0])
    ends = record.leader_moved if follower is None else follower.displacements
    return ends[timestep - 1].stamp_ns if timestep <= len(ends) else None


def pose_at_end(record: RunRecord, robot: str, timestep: int) -> Motion | None:
    """Return a robot's true pose at the end of a timestep, if it is known; 0 and before: after the first alignment."""
    stamp_ns = end_ns(record, robot, timestep)
    return None if stamp_ns is None else record.tracks[robot].at(stamp_ns)


def moves_of_timestep(record: RunRecord, follower: FollowerRecord, t: int) -> list[int]:
    """List the numbers of the moves of timestep t: from the displacement before to the t-th, if that exists.

    The first timestep's are those after the leader's first move; or, where robots move at the same time, the last ones
    that sum up to the displacement: before them come those of the first alignment.
    """
    if t > 1:
        start_ns: float = follower.displacements[t - 2].stamp_ns
    else:
        start_ns = record.leader_moved[0].stamp_ns if record.leader_moved else math.inf
    end_ns = follower.displacements[t - 1].stamp_ns if t <= len(follower.displacements) else math.inf
    found = [index for index, move in enumerate(follower.moved) if start_ns < move.stamp_ns <= end_ns]
    if t > 1 or not follower.displacements or _sums_up(follower, found):
        return found
    until = [index for index, move in enumerate(follower.moved) if move.stamp_ns <= end_ns]
    endings = (until[first:] for first in range(len(until) - 1, -1, -1))
    return next((moves for moves in endings if _sums_up(follower, moves)), found)


def _sums_up(follower: FollowerRecord, moves: Sequence[int]) -> bool:
    """Whether moves make the first displacement."""
    total = Motion()
    for index in moves:
        if follower.moved[index].motion.finite:
            total = total.then(follower.moved[index].motion)
    said = follower.displacements[0].motion
    parts = (total.x_m - said.x_m, total.y_m - said.y_m, total.yaw_rad - said.yaw_rad)
    return bool(moves) and all(abs(part) < _SAME for part in parts)


def chain_totals(record: RunRecord, follower: FollowerRecord, errors_m: Sequence[float | None]) -> JsonObject:
    """Sum up what concerns the whole chain.

    Args:
        record: the run.
        follower: one of its followers.
        errors_m: its formation errors, by timestep.

    Returns:
        `formation_error_max_m`; `leader_error_rmse_m`, against its place beside the leader; `lag_m`, the mean way by
        which the place is behind the one of rigid spacing, 0 if the spacing is rigid. None where unavailable.
    """
    number = follower_number(follower.name)
    place = record.leader_place(follower.name)
    errors, lags = [], []
    for t, displacement in enumerate(follower.displacements, 1):
        own = pose(record, follower.name, displacement.stamp_ns)
        neighbour = beacon_neighbour(follower.name)
        if record.delayed:
            leader = pose_at_end(record, LEADER, t - number)
            now, before = pose_at_end(record, neighbour, t), pose_at_end(record, neighbour, t - 1)
            if now is not None and before is not None:
                lags.append(math.hypot(now.x_m - before.x_m, now.y_m - before.y_m))
        else:
            leader = pose(record, LEADER, displacement.stamp_ns)
        if own is not None and leader is not None:
            errors.append(math.hypot(*formation_error_uv_m(own, leader, place)))
    return {
        "formation_error_max_m": max((error for error in errors_m if error is not None), default=None),
        "leader_error_rmse_m": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        "lag_m": float(np.mean(lags)) if lags else (None if record.delayed else 0.0),
    }
