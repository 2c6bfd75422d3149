"""Timesteps without a camera: which they are, and whether driving by forecast keeps the neighbour within view.

The camera's view is that of `precise.approach`: up to a bearing and a distance the marker is well seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robot_formation.alignment.precise.motion_planner import PlannerParameters
from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.uncertain_motion import UncertainMotion
from robot_formation.parameters import ParameterError

_ELLIPSE_90 = math.sqrt(-2.0 * math.log(0.1))
"""Half axes of a plane Gaussian's 90 % ellipse, in standard deviations."""


def blind_timesteps(blackouts: Sequence[int], where: str = "fine_tuner: 'blackouts'") -> frozenset[int]:
    """List the timesteps in which the camera is not used.

    Args:
        blackouts: pairs of first timestep and length, one after another.
        where: what errors begin with.

    Raises:
        ParameterError: if a number of a pair is missing or less than 1, or two blackouts overlap.
    """
    if len(blackouts) % 2:
        raise ParameterError(f"{where} takes pairs of first timestep and length; the last pair has no length")
    found: set[int] = set()
    for first, length in zip(blackouts[::2], blackouts[1::2], strict=True):
        if first < 1 or length < 1:
            raise ParameterError(f"{where}: [{first}, {length}] must begin in timestep 1 or later and last 1 or more")
        timesteps = range(first, first + length)
        if found.intersection(timesteps):
            raise ParameterError(f"{where}: [{first}, {length}] overlaps another blackout; join the two")
        found.update(timesteps)
    return frozenset(found)


def out_of_view(way: UncertainMotion | None, place: Motion, bounds: PlannerParameters) -> str:
    """Say why the neighbour may be out of view; nothing if its 90 % ellipse is within view and apart from the body.

    Args:
        way: the expected way to the formation position, from where the follower will stand.
        place: that position in the neighbour's frame.
        bounds: the camera's view and the bodies.
    """
    if way is None:
        return "nothing is known of where the neighbour is"
    neighbour = way.then(UncertainMotion(place.inverse()))
    x, y = neighbour.mean.x_m, neighbour.mean.y_m
    covariance = neighbour.matrix[:2, :2]
    distance = max(math.hypot(x, y), 1e-6)
    across, along = np.array([y, -x]) / distance, np.array([x, y]) / distance
    swing_rad = _ELLIPSE_90 * math.sqrt(max(0.0, float(across @ covariance @ across))) / distance
    if abs(math.atan2(x, y)) + swing_rad > bounds.view_rad:
        return "the neighbour may be beside the picture"
    spread = _ELLIPSE_90 * math.sqrt(max(0.0, float(along @ covariance @ along)))
    if distance + spread > bounds.reach_m:
        return "the neighbour may be too far to be seen"
    if y - _ELLIPSE_90 * math.sqrt(max(0.0, float(covariance[1, 1]))) < bounds.body_width_m:
        return "the neighbour may be in the way"
    return ""
