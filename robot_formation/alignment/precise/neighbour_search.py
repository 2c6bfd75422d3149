"""What to do when a look doesn't show the neighbour: hold, go back, turn, step to where it should be, or give up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from robot_formation.alignment.mode import Decision, Verdict
from robot_formation.geometry.se2 import Motion
from robot_formation.parameters import parameter


@dataclass(frozen=True)
class SearchParameters:
    """How long a lost neighbour is looked for, and where."""

    hold_looks: int = parameter(3, "Looks from the same place before the follower moves", low=1, high=1000)
    turn_rad: float = parameter(
        math.radians(25.0), "Turn to each side of the expected direction", unit="rad", low=0.01, high=1.0
    )
    max_step_m: float = parameter(0.05, "Longest step to where it is expected", unit="m", low=0.0, high=0.2)
    rounds: int = parameter(2, "Rounds of turns and steps before it counts as lost", low=0, high=100)


class NeighbourSearch:
    """One search: begins with the first look in vain and ends when the neighbour is seen again."""

    def __init__(self, parameters: SearchParameters) -> None:
        self._p = parameters
        self._plan: Iterator[Motion | None] | None = None
        self.looks = 0

    def found(self) -> None:
        """End the search: the neighbour is in view."""
        self._plan, self.looks = None, 0

    def missed(self, last: Motion, expected: Motion | None) -> Decision:
        """Decide after a look in vain.

        Args:
            last: the last correction as measured, no motion if there was none in this timestep.
            expected: way to the formation position by the estimate, None without one.
        """
        if self._plan is None:
            self._plan = self._steps(last, expected)
        self.looks += 1
        for motion in self._plan:
            if motion is None:
                return Decision(Verdict.LOOK, reason="no block in view")
            if motion != Motion():
                return Decision(Verdict.SEARCH, motion, "the neighbour is out of view")
        return Decision(Verdict.LOST, reason=f"not found again in {self.looks} looks")

    def _steps(self, last: Motion, expected: Motion | None) -> Iterator[Motion | None]:
        """Yield what to do after each look: None to look again, or a motion."""
        p = self._p
        for _ in range(p.hold_looks - 1):
            yield None
        yield last.inverse()
        for number in range(p.rounds):
            yield Motion(yaw_rad=p.turn_rad)
            yield Motion(yaw_rad=-2.0 * p.turn_rad)
            yield Motion(yaw_rad=p.turn_rad)
            if expected is not None and number == 0:
                length = math.hypot(expected.x_m, expected.y_m)
                share = min(1.0, p.max_step_m / length) if length > 0.0 else 0.0
                yield Motion(share * expected.x_m, share * expected.y_m, 0.0)
