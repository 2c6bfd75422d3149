"""Where robots of a chain stand: poses at the end of timesteps, errors against the leader, lag and gaps.

The leader's place of follower n is n times the formation distance to the leader's right; with delayed spacing where
that was n timesteps ago, since each robot keeps its place beside where its neighbour stood one timestep earlier.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robot_formation.analysis.run_record import FollowerRecord, RunRecord
from robot_formation.geometry.se2 import Motion, formation_error_uv_m
from robot_formation.json_values import JsonObject
from robot_formation.names import LEADER, beacon_neighbour


def pose(record: RunRecord, robot: str, stamp_ns: int) -> Motion | None:
    """Return a robot's true pose at a stamp, if it is known."""
    track = record.tracks.get(robot)
    return track.at(stamp_ns) if track else None


def pose_at_end(record: RunRecord, robot: str, timestep: int) -> Motion | None:
    """Return a robot's true pose at the end of a timestep, 0 and before: at the start; None if it isn't known."""
    track = record.tracks.get(robot)
    if track is None or not len(track.stamps_ns):
        return None
    if timestep <= 0:
        return track.at(int(track.stamps_ns[0]))
    ends = record.leader_moved
    if robot != LEADER:
        ends = next((found.displacements for found in record.followers if found.name == robot), ())
    return track.at(ends[timestep - 1].stamp_ns) if timestep <= len(ends) else None


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
    number = int(follower.name.rpartition("_")[2])
    place_m = number * record.formation_distance_m
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
            errors.append(math.hypot(*formation_error_uv_m(own, leader, place_m)))
    return {
        "formation_error_max_m": max((error for error in errors_m if error is not None), default=None),
        "leader_error_rmse_m": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        "lag_m": float(np.mean(lags)) if lags else (None if record.delayed else 0.0),
    }
