"""Measures of the time between the ends of timesteps: formation errors while robots move, gaps between bodies, touches.

They come from ground truth, which robots tell while they move, 20 times per second.

error in motion
    length of the formation error at any instant from the first timestep's beginning to the last report. With delayed
    spacing the place moves too: s seconds after a robot began to move in timestep t, its place is beside where its
    neighbour was s seconds after it had begun to move in t - 1, and at most at the end of that timestep.
gap
    distance of two neighbours' bodies seen from above, at the ground or at the height of their tops, whichever is less
    (on a bowl they are tilted towards each other). It is a lower bound: towards a corner the true distance is larger,
    and bodies at different heights are taken for level.
touch
    an episode that begins with a gap below a millimetre, and ends with one above 5 mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.analysis.chain import end_ns
from robot_formation.analysis.run_record import FollowerRecord, RunRecord, Track
from robot_formation.geometry.footprint import footprint_gaps_m
from robot_formation.geometry.se2 import Motion
from robot_formation.json_values import JsonObject
from robot_formation.names import beacon_neighbour

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

TOUCH_M, APART_M = 0.001, 0.005
LENGTH_M, WIDTH_M, TOP_M = 0.365, 0.238, 0.14
STATE_RATE_HZ = 20.0
"""Bodies, and how often a moving robot tells its pose, where a run doesn't say."""


@dataclass(frozen=True)
class Course:
    """A robot's poses at all times: a robot that moves does so evenly between two entries, one that stands has none.

    Attributes:
        stamps_ns: (n,) nanoseconds, in order.
        poses: (n, 5) world x, y [m], heading [rad, without jumps], and x and y of its z axis.
    """

    stamps_ns: Stamps
    poses: Array

    @classmethod
    def of(cls, track: Track, period_s: float) -> Course:
        """Make it from a track; a pause of more than one and a half periods is a stand, which ends a period before."""
        tilts = np.zeros((len(track.stamps_ns), 2)) if track.tilts is None else track.tilts
        poses = np.column_stack([track.positions_m[:, :2], np.unwrap(track.yaws_rad), tilts])
        period_ns = round(1e9 * period_s)
        pauses = np.flatnonzero(np.diff(track.stamps_ns) > 1.5 * period_ns)
        return cls(
            np.insert(track.stamps_ns, pauses + 1, track.stamps_ns[pauses + 1] - period_ns),
            np.insert(poses, pauses + 1, poses[pauses], axis=0),
        )

    def at(self, stamps_ns: Stamps) -> Array:
        """Return the poses at some instants, (m, 5); NaN before the first one that is known."""
        found = np.column_stack([np.interp(stamps_ns, self.stamps_ns, column) for column in self.poses.T])
        found[stamps_ns < self.stamps_ns[0]] = math.nan
        return found

    def begin_ns(self, after_ns: int, until_ns: int) -> int | None:
        """Return when the robot first moves between two instants, if it does."""
        first = int(np.searchsorted(self.stamps_ns, after_ns, side="right"))
        begin = int(self.stamps_ns[first]) if first < len(self.stamps_ns) else until_ns
        return begin if begin < until_ns else None


def motion_totals(record: RunRecord, follower: FollowerRecord) -> JsonObject:
    """Work out what happens between the ends of a follower's timesteps.

    Args:
        record: the run.
        follower: one of its followers.

    Returns:
        `formation_error_moving_max_m`, `gap_min_m` and `touches`, the last two between it and its beacon neighbour.
        None where unavailable.
    """
    own, neighbour = (_course(record, robot) for robot in (follower.name, beacon_neighbour(follower.name)))
    if own is None or neighbour is None:
        return {"formation_error_moving_max_m": None, "gap_min_m": None, "touches": None}
    stamps = np.union1d(own.stamps_ns, neighbour.stamps_ns)
    errors = _errors_m(record, follower, own, neighbour, stamps)
    gaps = gaps_m(record, own.at(stamps), neighbour.at(stamps))
    errors, gaps = errors[np.isfinite(errors)], gaps[np.isfinite(gaps)]
    return {
        "formation_error_moving_max_m": float(errors.max()) if errors.size else None,
        "gap_min_m": float(gaps.min()) if gaps.size else None,
        "touches": touches(gaps) if gaps.size else None,
    }


def gaps_m(record: RunRecord, own: Array, others: Array) -> Array:
    """Gaps (n,) of the bodies at poses as a `Course` has them, (n, 5) each, metres."""
    length_m, width_m, top_m = (
        record.said("world", f"chassis.{name}", default)
        for name, default in (("length_m", LENGTH_M), ("width_m", WIDTH_M), ("body_top_m", TOP_M))
    )

    def seen_from_above(poses: Array, height_m: float) -> Array:
        return np.column_stack([poses[:, :2] + height_m * poses[:, 3:], poses[:, 2]])

    at_ground, at_top = (
        footprint_gaps_m(seen_from_above(own, height_m), seen_from_above(others, height_m), length_m, width_m)
        for height_m in (0.0, top_m)
    )
    return np.minimum(at_ground, at_top)


def touches(gaps: Array) -> int:
    """Count episodes of touch in gaps (n,) in order of time, metres."""
    count, touching = 0, False
    for gap_m in gaps:
        if not touching and gap_m <= TOUCH_M:
            count, touching = count + 1, True
        elif gap_m >= APART_M:
            touching = False
    return count


def _course(record: RunRecord, robot: str) -> Course | None:
    track = record.tracks.get(robot)
    if track is None or not len(track.stamps_ns):
        return None
    return Course.of(track, 1.0 / record.said("world", "state_rate_hz", STATE_RATE_HZ))


def _errors_m(record: RunRecord, follower: FollowerRecord, own: Course, neighbour: Course, stamps: Stamps) -> Array:
    """Lengths of the formation error at those of the instants that are between first and last end of a timestep."""
    names = (follower.name, beacon_neighbour(follower.name))
    starts = [end_ns(record, robot, 0) for robot in names]
    last = end_ns(record, follower.name, len(follower.displacements))
    known = [start for start in starts if start is not None]
    if len(known) < len(starts) or last is None or not follower.displacements:
        return np.empty(0)
    stamps = stamps[(stamps >= max(known)) & (stamps <= last)]
    meant = _delayed_ns(record, follower, own, neighbour, stamps) if record.delayed else stamps
    return place_errors_m(own.at(stamps)[:, :2], neighbour.at(meant)[:, :3], record.place(follower.name))


def place_errors_m(own: Array, neighbour: Array, place: Motion) -> Array:
    """Return how far (n,) places (n, 2) are from those meant, metres.

    Args:
        own: the follower's places, world x and y.
        neighbour: its beacon neighbour's poses (n, 3) then: world x, y and yaw.
        place: its place in that robot's frame.
    """
    cosine, sine = np.cos(neighbour[:, 2]), np.sin(neighbour[:, 2])
    away = np.column_stack([cosine * place.x_m - sine * place.y_m, sine * place.x_m + cosine * place.y_m])
    return np.asarray(np.linalg.norm(own - neighbour[:, :2] - away, axis=1))


def _delayed_ns(record: RunRecord, follower: FollowerRecord, own: Course, neighbour: Course, stamps: Stamps) -> Stamps:
    """Return for each instant when the neighbour was where the follower's place is then."""
    beside = beacon_neighbour(follower.name)
    found = np.full(len(stamps), end_ns(record, beside, 0) or 0, dtype=np.int64)
    for t in range(2, len(follower.displacements) + 1):
        start, end = (end_ns(record, follower.name, number) for number in (t - 1, t))
        first, last = (end_ns(record, beside, number) for number in (t - 2, t - 1))
        if start is None or end is None or first is None or last is None:
            continue
        inside = (stamps > start) & (stamps <= end)
        begun, began = own.begin_ns(start, end), neighbour.begin_ns(first, last)
        since = np.maximum(stamps[inside] - (start if begun is None else begun), 0)
        found[inside] = np.minimum((last if began is None else began) + since, last)
    return found
