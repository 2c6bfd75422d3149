"""Where the robots of a rigid formation are while its leader follows a path: poses, the area they take, a start."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths import LeaderPath, Room, poses

MARGIN_M = 0.05
"""Left free around the bodies where a start is chosen: robots slip, and a formation is never exact."""


def follower_step(step: Motion, number: int, distance_m: float) -> Motion:
    """Return the motion of follower `number` (from 1; 0: the leader's own) that keeps its place during a leader's step.

    T_n = O^-1 T O, where O leads from the leader to the follower's place, number * distance_m to its right.
    """
    place = Motion(0.0, -number * distance_m)
    moved = place.inverse().then(step).then(place)
    return Motion(moved.x_m, moved.y_m + 0.0, moved.yaw_rad)


@dataclass(frozen=True)
class Formation:
    """A rigid formation: the leader and followers beside it, each `distance_m` to the right of the one before.

    Attributes:
        followers: how many.
        distance_m: between the origins of base_link.
        length_m: of a body, along x.
        width_m: of a body, along y.
    """

    followers: int
    distance_m: float
    length_m: float
    width_m: float

    def corners(self, leader: Motion, number: int) -> list[tuple[float, float]]:
        """List the corners of a robot's body in the frame that the leader's pose is in, metres."""
        robot = leader.then(Motion(0.0, -number * self.distance_m))
        ends = [(x * 0.5 * self.length_m, y * 0.5 * self.width_m) for x in (1.0, -1.0) for y in (1.0, -1.0)]
        placed = (robot.then(Motion(x, y)) for x, y in ends)
        return [(corner.x_m, corner.y_m) for corner in placed]

    def extent(self, leader: Motion) -> Extent:
        """Area that all bodies take with the leader at a pose; a box along the axes of the frame that it is in."""
        # The robots stand in a row: those at its ends reach farthest.
        found = [corner for number in {0, self.followers} for corner in self.corners(leader, number)]
        xs, ys = [x for x, _ in found], [y for _, y in found]
        return Extent(min(xs), max(xs), min(ys), max(ys))


@dataclass(frozen=True)
class Extent:
    """A box along two axes, metres."""

    low_x_m: float
    high_x_m: float
    low_y_m: float
    high_y_m: float

    @property
    def size_m(self) -> float:
        """Its longer side."""
        return max(self.high_x_m - self.low_x_m, self.high_y_m - self.low_y_m)

    @property
    def middle(self) -> tuple[float, float]:
        """Its centre."""
        return 0.5 * (self.low_x_m + self.high_x_m), 0.5 * (self.low_y_m + self.high_y_m)

    def joined(self, other: Extent) -> Extent:
        """Return the smallest box around both."""
        return Extent(
            min(self.low_x_m, other.low_x_m),
            max(self.high_x_m, other.high_x_m),
            min(self.low_y_m, other.low_y_m),
            max(self.high_y_m, other.high_y_m),
        )


def swept(formation: Formation, path: LeaderPath, timesteps: int, heading_rad: float) -> Extent:
    """Area that all bodies take over a run whose leader starts at the origin with a heading; along the world's axes."""
    start = Motion(yaw_rad=heading_rad)
    found = formation.extent(start)
    for pose in poses(path, timesteps)[1:]:
        found = found.joined(formation.extent(start.then(pose)))
    return found


def centred_start(extent: Extent, plate_m: float) -> tuple[float, float]:
    """Return the leader's start, world x and y, that puts the middle of what is swept from (0, 0) on the plate's."""
    x_m, y_m = extent.middle
    return 0.5 * plate_m - x_m, 0.5 * plate_m - y_m


def room_around(formation: Formation, start: Motion, plate_m: float) -> Room:
    """Return how far a leader that keeps its heading may go from its start, so that all bodies stay on the plate.

    The room is a rectangle along the leader's axes; where those are not the plate's, the largest one of equal sides.
    """
    at = formation.extent(start)
    east, west = plate_m - MARGIN_M - at.high_x_m, at.low_x_m - MARGIN_M
    north, south = plate_m - MARGIN_M - at.high_y_m, at.low_y_m - MARGIN_M
    quarter = math.remainder(start.yaw_rad, 2.0 * math.pi) / (0.5 * math.pi)
    sides = [max(side, 0.0) for side in (east, north, west, south)]
    if abs(quarter - round(quarter)) < 1e-9:
        ahead = round(quarter) % 4
        return Room(*(sides[(ahead + turn) % 4] for turn in (0, 2, 1, 3)))
    share = abs(math.cos(start.yaw_rad)) + abs(math.sin(start.yaw_rad))
    return Room(*(min(sides) / share,) * 4)
