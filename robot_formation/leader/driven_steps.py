"""A person's velocity commands become the leader's motions: sampled and held, clamped, stopped when none comes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths import Teleop

_DIGITS = 6
"""Motions are whole micrometres and microradians: a file of them is short, and read back exactly."""


@dataclass(frozen=True)
class Velocity:
    """Velocity of the leader: ahead and to the left [m/s], anticlockwise [rad/s]."""

    ahead_m_s: float
    left_m_s: float
    turn_rad_s: float

    @property
    def usable(self) -> bool:
        """Whether it is finite."""
        return all(map(math.isfinite, (self.ahead_m_s, self.left_m_s, self.turn_rad_s)))


class DrivenSteps:
    """Holds the newest velocity and makes a timestep's motion of it.

    Times are seconds of a wall clock from any origin: a person's time, in which the simulated one may stand still.
    """

    def __init__(self, parameters: Teleop) -> None:
        self._p = parameters
        self._newest = Velocity(0.0, 0.0, 0.0)
        self._heard_s = -math.inf

    def command(self, velocity: Velocity, now_s: float) -> bool:
        """Take a velocity; return False and keep the last one if it isn't finite."""
        if not velocity.usable:
            return False
        self._newest, self._heard_s = velocity, now_s
        return True

    def motion(self, now_s: float) -> Motion | None:
        """Return the motion of a timestep that begins now; None while nobody drives.

        Not when the newest velocity is zero or older than the dead man's time.
        """
        if now_s - self._heard_s > self._p.timeout_s:
            return None
        motion = step_of(self._newest, self._p)
        return None if motion == Motion() else motion


def step_of(velocity: Velocity, parameters: Teleop) -> Motion:
    """Hold a velocity over a timestep's nominal duration and clamp what comes of it, each component by itself.

    The way is the arc of a circle that a robot with constant velocity in its own frame drives.
    """
    p = parameters
    turn = _clamped(velocity.turn_rad_s * p.duration_s, math.radians(p.max_turn_deg))
    ahead_m = _clamped(velocity.ahead_m_s * p.duration_s, p.max_forward_m)
    left_m = _clamped(velocity.left_m_s * p.duration_s, p.max_sideways_m)
    half = 0.5 * turn
    shrunk = math.sin(half) / half if half else 1.0
    cosine, sine = shrunk * math.cos(half), shrunk * math.sin(half)
    parts = (cosine * ahead_m - sine * left_m, sine * ahead_m + cosine * left_m, turn)
    return Motion(*(round(part, _DIGITS) + 0.0 for part in parts))


def _clamped(value: float, most: float) -> float:
    return max(-most, min(most, value))
