"""A curve whose curvature rises and falls evenly with the way driven."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robot_formation.geometry.se2 import Motion
from robot_formation.leader.paths.base import Heading, PathKind
from robot_formation.leader.paths.straight import STEP
from robot_formation.leader.paths.waves import PHASE
from robot_formation.parameters import Choice, parameter


class Sides(Choice):
    """To which side a clothoid bends."""

    LEFT = "left"
    RIGHT = "right"
    BOTH = "both"


@dataclass(frozen=True)
class Clothoid(PathKind):
    """Pieces of clothoids: the curvature goes evenly from 0 to 1 / radius_m and back, once per period.

    With direction=both each second period bends to the other side. step_m is measured along the path.
    """

    name: ClassVar[str] = "clothoid"
    step_m: float = STEP
    radius_m: float = parameter(0.5, "least radius", unit="m", low=0.01, high=100.0)
    period: float = parameter(20.0, "timesteps from straight over the least radius to straight", low=2.0, high=1e6)
    phase: float = PHASE
    heading: Heading = parameter(Heading.ALONG, "where the leader looks")
    direction: Sides = parameter(Sides.BOTH, "to which side it bends")

    def motion(self, timestep: int) -> Motion:
        """See `LeaderPath`: integrated piece by piece by Gauss-Legendre quadrature, to rounding."""
        x_m = y_m = 0.0
        start = self._turned(timestep - 1.0)
        origin = start if self.heading is Heading.ALONG else self._turned(0.0)
        for begin, end in itertools.pairwise(self._pieces(timestep)):
            middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
            for node, weight in _quadrature():
                angle = self._turned(middle + half * node) - origin
                x_m += weight * half * self.step_m * math.cos(angle)
                y_m += weight * half * self.step_m * math.sin(angle)
        turn = self._turned(float(timestep)) - start if self.heading is Heading.ALONG else 0.0
        return Motion(x_m, y_m, turn)

    def _pieces(self, timestep: int) -> list[float]:
        """List the ends of a timestep, and the times in it when the curvature begins to rise or to fall."""
        half, offset = 0.5 * self.period, self.phase * self.period
        first = math.floor((timestep - 1 + offset) / half) + 1
        last = math.ceil((timestep + offset) / half)
        kinks = [number * half - offset for number in range(first, last)]
        return [timestep - 1.0, *(kink for kink in kinks if timestep - 1 < kink < timestep), float(timestep)]

    def _turned(self, time: float) -> float:
        """Integral of the curvature over the way driven since time 0 of phase 0, radians."""
        periods, rest = divmod(time / self.period + self.phase, 1.0)
        one = 0.5 * self.step_m * self.period / self.radius_m  # the turn of a period: the triangle's area
        part = 2.0 * rest * rest if rest < 0.5 else 1.0 - 2.0 * (1.0 - rest) ** 2
        if self.direction is Sides.BOTH:
            return one * (part if int(periods) % 2 == 0 else 1.0 - part)
        return one * (periods + part) * (1.0 if self.direction is Sides.LEFT else -1.0)


@functools.cache
def _quadrature() -> list[tuple[float, float]]:
    """Return nodes and weights of Gauss-Legendre quadrature on -1 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    return list(zip(nodes.tolist(), weights.tolist(), strict=True))
