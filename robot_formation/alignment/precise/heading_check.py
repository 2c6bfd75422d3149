"""When to look at the neighbour's heading anew, from a place from where two of the marker's faces show.

Straight aside of the marker one face shows, and the heading follows only from how far the neighbour's steps lead aside.
For a leader that turns this is not enough: slip and forecast err alike step after step, which the filter takes for
independent noise, and a turn that nothing foretold looks like a step aside. So after a turn of some size, or when steps
end beside where they were expected, the follower drives to where the heading shows, as in its first alignment, and
back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from robot_formation.parameters import parameter

# All chosen.
_MEMORY = 0.6
"""Share of earlier deviations in the sum that is compared with the bound: turns lead several steps to the same side."""
_EARLY = 5
"""Deviations before their own scatter is known well enough: until then the forecasts' standard deviations count."""
_FIRST_SCATTER_M, _LEAST_SCATTER_M = 0.003, 0.0015
"""Scatter of the deviations beforehand, and the least: of leaders that drive straight ahead it is 1.5 to 2.5 mm."""
_SCATTER_GAIN, _SCATTER_MARGIN = 0.15, 1.25
"""Weight of the latest deviation in the mean of their squares, and a factor on what follows from so few. Without it
the larger deviations of `previous` and `measured` called for checks of leaders that drive straight ahead."""
_OUTLIER_SIGMAS = 3.0
"""A deviation counts as so many times the scatter at most: else a turn would hide itself by the scatter it makes."""
_FOUND_RAD = math.radians(3.0)
"""A heading that a check finds so far from where it was expected had turned unnoticed."""
_UNEXPECTED_RAD = 2.0 * _FOUND_RAD
"""The same where a turn by forecast has called for the check: slip and forecasts err by up to 5 degrees until then."""
_HALFWAY = 0.5
"""Share of both bounds, of turns and of deviations, from which on the two together call for a check: the end of a turn
shows as deviations, and before the next check of a turn the follower would turn on for up to four timesteps."""
_FOLLOW_UPS = 2
"""Checks in the timesteps after an unnoticed turn: from them the predictor learns the turn of a timestep."""
_CAUGHT_UP = 0.5
"""Standard deviation of what a check makes good of earlier timesteps, share of what it finds."""
_MOST_PATIENCE, _PATIENCE_KEPT = 16.0, 0.85
"""Bound on the factor by which the bound on deviations grows, and what is left of it after a timestep."""


@dataclass(frozen=True)
class HeadingCheckParameters:
    """What calls for a check."""

    turned_rad: float = parameter(
        0.2, "Turn of the neighbour by forecast, after which its heading is checked", unit="rad", low=1e-3, high=1000.0
    )
    beside_sigmas: float = parameter(
        3.0,
        "Sum of the steps' deviations aside from their forecasts, in standard deviations of such deviations so far, "
        "earlier ones counting less, from which on the heading is checked; twice as much after each check that finds "
        "no turn, half as much after half of turned_rad",
        low=0.1,
        high=1e6,
    )
    sigma_rad: float = parameter(
        0.2, "Standard deviation of the heading from which on it is checked", unit="rad", low=1e-3, high=1000.0
    )
    doubt_rad: float = parameter(
        0.075,
        "Standard deviation that a check adds to the heading's before it looks",
        unit="rad",
        low=1e-3,
        high=1.0,
    )


class Deviation(NamedTuple):
    """How far aside of its forecast the neighbour's step ended, and the standard deviation that the forecast states."""

    aside_m: float
    sigma_m: float


class _Scatter:
    """How far steps usually end aside of their forecasts: a forecast's own covariance is two to four times too wide."""

    def __init__(self) -> None:
        self._square_m2 = _FIRST_SCATTER_M**2
        self._count = 0

    def in_sigmas(self, deviation: Deviation) -> float:
        """Return a deviation in standard deviations of the earlier ones, and count it in."""
        usual_m = max(_SCATTER_MARGIN * math.sqrt(self._square_m2), _LEAST_SCATTER_M)
        scatter_m = deviation.sigma_m if self._count < _EARLY else min(usual_m, deviation.sigma_m)
        counted_m = min(abs(deviation.aside_m), _OUTLIER_SIGMAS * scatter_m)
        self._square_m2 += _SCATTER_GAIN * (counted_m**2 - self._square_m2)
        self._count += 1
        return deviation.aside_m / scatter_m


class HeadingCheck:
    """Keeps what calls for a check, from one timestep to the next.

    Attributes:
        caught_up_rad: standard deviation of what the latest timestep's check makes good of earlier timesteps; 0 where
            a deviation has called for it, where a turn has and the check finds much else than was forecast, and in
            follow-ups: what these find was made in that timestep, as far as anybody knows.
    """

    def __init__(self, parameters: HeadingCheckParameters) -> None:
        self._p = parameters
        self._turned_rad = 0.0
        self._beside_sigmas = 0.0
        self._scatter = _Scatter()
        self._patience = 1.0
        self._follow_ups = 0
        self._beside = self._turned = self._follow_up = False  # what called for the latest check
        self.caught_up_rad = 0.0

    def stepped(self, turn_rad: float) -> None:
        """Process the forecast turn of the neighbour's step."""
        self.caught_up_rad = 0.0
        self._turned_rad += turn_rad
        self._patience = max(1.0, _PATIENCE_KEPT * self._patience)

    def due(self, deviation: Deviation | None, sigma_rad: float) -> bool:
        """Process a timestep's first look, and tell whether the heading is to be checked.

        Args:
            deviation: of the neighbour's step from its forecast, where both are known.
            sigma_rad: standard deviation of the heading.
        """
        p = self._p
        self._beside_sigmas *= _MEMORY
        if deviation is not None:
            self._beside_sigmas += self._scatter.in_sigmas(deviation)
        self._beside = self._turned = False
        self._follow_up = self._follow_ups > 0
        if self._follow_up:
            self._follow_ups -= 1
            return True
        beside = abs(self._beside_sigmas) / (self._patience * p.beside_sigmas)
        turned = abs(self._turned_rad) / p.turned_rad
        self._beside = beside > 1.0
        self._turned = turned > 1.0 or min(beside, turned) > _HALFWAY
        return self._beside or self._turned or sigma_rad > p.sigma_rad

    def done(self, change_rad: float) -> None:
        """Process a check: how far from where it was expected the heading was found."""
        self._turned_rad = self._beside_sigmas = 0.0
        if self._follow_up:
            return
        unexpected = self._turned and abs(change_rad) >= _UNEXPECTED_RAD
        if not (self._beside or unexpected):
            self.caught_up_rad = _CAUGHT_UP * abs(change_rad)
        elif abs(change_rad) > _FOUND_RAD:
            self._patience, self._follow_ups = 1.0, _FOLLOW_UPS
        else:
            self._patience = min(_MOST_PATIENCE, 2.0 * self._patience)
