"""How far prediction moves usually end beside what was commanded: to be taken off the next commands.

A robot coasts some 3 mm on, however long the move is, and slips aside. A follower of a delayed place drives what it saw
to be left, without a correction afterwards: uncompensated, it would stand that much beside its place all the time.

Two other parts know errors of drives. `alignment.precise.actuation_model` serves corrections and the pose filter; the
predictor's actuation bias serves residual feedback with rigid places, where the predictor chooses the command.
"""

from __future__ import annotations

import math

from robot_formation.geometry.se2 import Motion, into_frame

# Chosen.
_LEAST_GAIN = 0.25
"""Weight of the latest move in the mean, from the third on; the first counts a half and the second a third, since the
mean begins with a sample of zero."""
_LEAST_WAY_M = 0.02
"""A shorter move teaches nothing, and is commanded as it is: legs of millimetres end short."""
_MOST_ERROR_M = 0.01
"""A move that ends farther beside its command was braked, refused or pushed."""


class _RunningMean:
    """Running mean of errors along v and to the left [m], forgetting old ones."""

    def __init__(self) -> None:
        self.ahead_m = self.left_m = 0.0
        self._samples = 1

    def add(self, ahead_m: float, left_m: float) -> None:
        self._samples += 1
        gain = max(1.0 / self._samples, _LEAST_GAIN)
        self.ahead_m += gain * (ahead_m - self.ahead_m)
        self.left_m += gain * (left_m - self.left_m)


class MeanActuationError:
    """Mean errors of moves; those of moves backwards apart, where the robot coasts the other way."""

    def __init__(self) -> None:
        """Know of no move: all means are zero."""
        self._ahead, self._back = _RunningMean(), _RunningMean()

    def learn(self, commanded: Motion, error: Motion) -> None:
        """Process a move that ended `error` (measured less commanded, in the frame of its start) beside its command."""
        turn, forward, left = commanded.legs
        if math.hypot(forward, left) < _LEAST_WAY_M or math.hypot(error.x_m, error.y_m) > _MOST_ERROR_M:
            return
        self._mean(forward).add(*into_frame(error.x_m, error.y_m, turn))

    def compensated(self, desired: Motion) -> Motion:
        """Return what to command so that the desired displacement comes about."""
        turn, forward, left = desired.legs
        if math.hypot(forward, left) < _LEAST_WAY_M:
            return desired
        mean = self._mean(forward)
        return Motion.from_legs(turn, forward - mean.ahead_m, left - mean.left_m)

    def _mean(self, forward_m: float) -> _RunningMean:  # a leg back that is shorter than an error counts as none
        return self._back if forward_m < -_MOST_ERROR_M else self._ahead
