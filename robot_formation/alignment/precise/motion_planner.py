"""Next correction on the way beside the neighbour: all axes at once where the bodies stay apart and the marker in view.

Positions are planned in the neighbour's frame. The drive makes a motion's legs one after the other: turn, v, u.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot_formation.alignment.precise.actuation_model import MOST_COMPENSATION_M
from robot_formation.alignment.precise.marker_projection import Vector, X, Y, after_motion, pose_of
from robot_formation.geometry.footprint import footprint_gap_m
from robot_formation.geometry.se2 import Motion, into_frame
from robot_formation.parameters import parameter

# All chosen; docs/explanation/alignment.md ("Constants") says how far runs depend on the costs and the spare room.
# Costs count in metres of way still to go.
_LEG_COST_M = 0.02
"""Of each leg: a leg costs one of the timestep's moves."""
_HIDDEN_COST_M = 0.25
"""Of an end from where the marker isn't well in view; more than the longest leg."""
_DETOUR_COST_M = 0.3
"""Of an end from where the direct way doesn't keep clear."""
_TURN_COST_M_PER_RAD = 0.15
"""Of what is left to turn; a robot's corners move by 0.22 m per radian."""
_PATH_POINTS = 5
"""Points of a leg, its start included, at which the bodies' gap is computed: 5 cm apart on the longest."""
_AWAY_M = 0.05
"""Step away from a neighbour that is too close; as the paper's coarse step."""
_FACE_SHARES, _FACE_STEPS_M = (1.0, 0.6, 0.3), (0.08, 0.04)
"""Shares of the turn towards the marker, and then steps away from it, of which the first that keeps clear is made."""
_YAWS_RAD = (-0.35, 0.35)
"""Turns that candidates try besides that to the goal: 20 degrees."""
_FORWARDS_M, _LEFTS_M = (0.05, -0.05, 0.15, -0.15), (-0.05, 0.05)
"""Legs that candidates try besides those to the goal: short and long ones around the neighbour."""
_NO_LEG = 1e-9
"""Metres or radians up to which a component is what rounding leaves of a leg that wasn't asked for."""
_ROUNDING_M = 1e-6
"""Larger than what rounding adds to a leg's length, smaller than any leg that is worth a move."""
_SPARE_M = MOST_COMPENSATION_M + 0.002
"""How much shorter than the longest corrections a direct way's legs stay: room for what the actuation model adds."""


@dataclass(frozen=True)
class PlannerParameters:
    """Bodies, and how far one correction may lead."""

    body_length_m: float = parameter(0.365, "Length of a robot", unit="m", low=0.0, high=5.0)
    body_width_m: float = parameter(0.238, "Width of a robot", unit="m", low=0.0, high=5.0)
    clearance_m: float = parameter(0.025, "Least gap between the bodies on the way", unit="m", low=0.0, high=1.0)
    max_v_m: float = parameter(0.2, "Longest correction along v", unit="m", low=0.001, high=10.0)
    max_u_m: float = parameter(0.1, "Longest correction along u", unit="m", low=0.001, high=10.0)
    max_turn_rad: float = parameter(1.0, "Largest correction in heading", unit="rad", low=0.01, high=6.3)
    view_rad: float = parameter(0.42, "Bearing up to which the marker is well in view", unit="rad", low=0.05, high=1.5)
    reach_m: float = parameter(0.75, "Distance up to which the marker is well seen", unit="m", low=0.1, high=10.0)


class MotionPlanner:
    """Plans one correction at a time."""

    def __init__(self, parameters: PlannerParameters) -> None:
        self._p = parameters

    def next(self, states: Sequence[Vector], goal: Motion) -> Motion:
        """Choose the next motion towards a goal; no motion if there is none that keeps clear.

        Args:
            states: where the neighbour may stand (6,), the likeliest first; the way keeps clear of all.
            goal: place and heading to get to, in the neighbour's frame.
        """
        state = states[0]
        way = pose_of(state).then(goal)
        if self._direct(way) and all(self._clear(other, way) for other in states):
            return way
        best, least = Motion(), math.inf
        for motion in self._candidates(way):
            if not count_legs(motion) or not all(self._clear(other, motion) for other in states):
                continue
            cost = self._cost(after_motion(state, motion), goal) + _LEG_COST_M * count_legs(motion)
            if cost < least:
                best, least = motion, cost
        return best

    def face(self, states: Sequence[Vector]) -> Motion:
        """Turn towards the neighbour, as far as that keeps clear wherever it may stand; else step away a little."""
        bearing = -math.atan2(states[0][X], states[0][Y])
        turns = [Motion(yaw_rad=share * _clip(bearing, self._p.max_turn_rad)) for share in _FACE_SHARES]
        for motion in [*turns, *(Motion(y_m=-step) for step in _FACE_STEPS_M)]:
            if all(self._clear(state, motion) for state in states):
                return motion
        return Motion()

    def away(self, states: Sequence[Vector]) -> Motion:
        """Step aside from a neighbour that is too close; no motion if that brings the bodies nearer."""
        motion = Motion(y_m=-_AWAY_M)
        return motion if all(self._clear(state, motion) for state in states) else Motion()

    def moves(self, way: Motion) -> int:
        """Count the corrections, axes apart, that a way takes at least."""
        turn, forward, left = way.legs
        parts = (forward / self._p.max_v_m, left / self._p.max_u_m, turn / self._p.max_turn_rad)
        return sum(math.ceil(abs(part) - _ROUNDING_M) for part in parts)

    def apart(self, state: Vector) -> bool:
        """Whether the bodies keep their distance."""
        return self._gap(state) >= self._p.clearance_m

    def _direct(self, way: Motion) -> bool:
        turn, forward, left = way.legs
        p, spare = self._p, _SPARE_M
        return abs(forward) <= p.max_v_m - spare and abs(left) <= p.max_u_m - spare and abs(turn) <= p.max_turn_rad

    def _candidates(self, way: Motion) -> list[Motion]:
        p = replace(self._p, max_v_m=self._p.max_v_m - _ROUNDING_M, max_u_m=self._p.max_u_m - _ROUNDING_M)
        turn = _clip(way.yaw_rad, p.max_turn_rad)
        found = []
        for yaw in dict.fromkeys((turn, 0.0, 0.5 * turn, *_YAWS_RAD)):
            forward, left = into_frame(way.x_m, way.y_m, yaw)
            forwards = dict.fromkeys((_clip(forward, p.max_v_m), 0.0, *_FORWARDS_M))
            lefts = dict.fromkeys((_clip(left, p.max_u_m), 0.0, _LEFTS_M[0], -p.max_u_m, _LEFTS_M[1]))
            for x, y in itertools.product(forwards, lefts):
                found.append(Motion.from_legs(yaw, x, y))
        return found

    def _cost(self, state: Vector, goal: Motion) -> float:
        way = pose_of(state).then(goal)
        cost = math.hypot(way.x_m, way.y_m) + _TURN_COST_M_PER_RAD * abs(way.yaw_rad)
        if not self._clear(state, way):
            cost += _DETOUR_COST_M
        bearing = abs(math.atan2(state[X], state[Y]))
        distance = math.hypot(state[X], state[Y])
        hidden = max(0.0, bearing - self._p.view_rad) + max(0.0, distance - self._p.reach_m)
        return cost + (_HIDDEN_COST_M + hidden if hidden > 0.0 else 0.0)

    def _clear(self, state: Vector, motion: Motion) -> bool:
        """Whether a motion keeps the bodies apart, or at least does not bring them nearer."""
        least = min(self._p.clearance_m, self._gap(state) - _ROUNDING_M)
        turn, forward, left = motion.legs
        for leg in (Motion(yaw_rad=turn), Motion(x_m=forward), Motion(y_m=left)):
            if leg == Motion():
                continue
            for share in np.linspace(0.0, 1.0, _PATH_POINTS)[1:]:
                part = Motion(leg.x_m * share, leg.y_m * share, leg.yaw_rad * share)
                if self._gap(after_motion(state, part)) < least:
                    return False
            state = after_motion(state, leg)
        return True

    def _gap(self, state: Vector) -> float:
        return footprint_gap_m(pose_of(state), self._p.body_length_m, self._p.body_width_m)


def count_legs(motion: Motion) -> int:
    """Count the axes that a motion uses in the follower's frame after its turn."""
    return sum(abs(length) > _NO_LEG for length in motion.legs)


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
