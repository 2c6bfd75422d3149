"""Where the robots of a rigid formation are while its leader follows a path: poses, the area they take, a start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths import LeaderPath, Room, poses

Track = NDArray[np.float64]

MARGIN_M = 0.05
"""Left free around the bodies where a start is chosen: robots slip, and a formation is never exact."""


def follower_step(step: Motion, place: Motion) -> Motion:
    """Return the motion that keeps a `place` in the leader's frame during a leader's step.

    T_n = O^-1 T O, where O leads from the leader to the place.
    """
    if not step.yaw_rad:
        return step  # the same for all, without rounding
    return place.inverse().then(step).then(place)


@dataclass(frozen=True)
class Formation:
    """A rigid formation: the leader and its followers.

    Attributes:
        places: of all robots in the leader's frame, the leader's own first.
        length_m: of a body, along x.
        width_m: of a body, along y.
    """

    places: Sequence[Motion]
    length_m: float
    width_m: float

    def boxes(self, track: Track, robots: Sequence[int] = ()) -> Track:
        """Boxes around the bodies at each of the leader's poses, along the axes of the frame that these are in.

        Args:
            track: x, y [m] and heading [rad] of the leader, shape (n, 3).
            robots: numbers of the robots that count, 0 for the leader; none given: all.

        Returns:
            Lowest x, highest x, lowest y and highest y of each box, shape (n, 4), metres.
        """
        cosine, sine = np.cos(track[:, 2]), np.sin(track[:, 2])
        half_x = 0.5 * (np.abs(cosine) * self.length_m + np.abs(sine) * self.width_m)
        half_y = 0.5 * (np.abs(sine) * self.length_m + np.abs(cosine) * self.width_m)
        places = [self.places[number] for number in robots or range(len(self.places))]
        xs = np.array([track[:, 0] + (place.x_m * cosine - place.y_m * sine) for place in places])
        ys = np.array([track[:, 1] + (place.x_m * sine + place.y_m * cosine) for place in places])
        return np.stack(
            [xs.min(0) - half_x, xs.max(0) + half_x, ys.min(0) - half_y, ys.max(0) + half_y],
            axis=1,
        )


def track_of(path: LeaderPath, timesteps: int, start: Motion) -> Track:
    """Return the leader's poses, start and end of every timestep: x, y [m] and heading [rad], (timesteps + 1, 3)."""
    return np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses(path, timesteps, start)])


def around(boxes: Track) -> Track:
    """Return the box around all boxes up to each one, shape (n, 4)."""
    low, high = np.minimum.accumulate, np.maximum.accumulate
    return np.stack([low(boxes[:, 0]), high(boxes[:, 1]), low(boxes[:, 2]), high(boxes[:, 3])], axis=1)


def centred_start(swept: Track, plate_m: float) -> tuple[float, float]:
    """Return the leader's start, world x and y, that puts the middle of what is swept from (0, 0) on the plate's.

    Args:
        swept: the box around everything, shape (4,).
        plate_m: edge of the plate.
    """
    low_x, high_x, low_y, high_y = map(float, swept)
    return 0.5 * (plate_m - low_x - high_x), 0.5 * (plate_m - low_y - high_y)


def room_around(formation: Formation, start: Motion, plate_m: float) -> Room:
    """Return how far a leader that keeps its heading may go from its start, so that all bodies stay on the plate.

    The room is a rectangle along the leader's axes; where those are not the plate's, the largest one of equal sides.
    """
    low_x, high_x, low_y, high_y = map(float, formation.boxes(np.array([(start.x_m, start.y_m, start.yaw_rad)]))[0])
    east, west = plate_m - MARGIN_M - high_x, low_x - MARGIN_M
    north, south = plate_m - MARGIN_M - high_y, low_y - MARGIN_M
    quarter = math.remainder(start.yaw_rad, 2.0 * math.pi) / (0.5 * math.pi)
    sides = [max(side, 0.0) for side in (east, north, west, south)]
    if abs(quarter - round(quarter)) < 1e-9:
        ahead = round(quarter) % 4
        return Room(*(sides[(ahead + turn) % 4] for turn in (0, 2, 1, 3)))
    share = abs(math.cos(start.yaw_rad)) + abs(math.sin(start.yaw_rad))
    return Room(*(min(sides) / share,) * 4)
