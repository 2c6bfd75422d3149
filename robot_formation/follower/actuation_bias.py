"""How far prediction moves end beside what was commanded: what the next one to a delayed place is asked for less.

Drives ahead coast, downhill farther, and slip aside: some 3 mm on a step of 3 to 5 cm. A follower of a delayed place
drives what it sees to be left, so that a move that is too long by a share e makes the transfer from its neighbour's
displacements to its own T(z) = (1 + e) / (z + e). Its gain at a period of two timesteps is (1 + e) / (1 - e), 1.2 for
e = 0.1: a change of step would grow along the chain, with every other robot doing too much and then too little.
"""

from __future__ import annotations

import math

from robot_formation.geometry.se2 import Motion

# Chosen.
_LEAST_GAIN = 0.25
"""Weight of the latest move in the mean, once there are four."""
_LEAST_WAY_M = 0.02
"""A shorter move teaches nothing, and is commanded as it is: legs of millimetres end short."""


class ActuationBias:
    """Mean of measured less commanded displacement, along v and u."""

    def __init__(self) -> None:
        """Know of no move: its bias counts as zero, like one move."""
        self._ahead_m = self._left_m = 0.0
        self._moves = 1

    def learn(self, commanded: Motion, error: Motion) -> None:
        """Process a prediction move that ended `error` beside what was commanded."""
        if not _long(commanded):
            return
        self._moves += 1
        gain = max(1.0 / self._moves, _LEAST_GAIN)
        self._ahead_m += gain * (error.x_m - self._ahead_m)
        self._left_m += gain * (error.y_m - self._left_m)

    def taken_off(self, wish: Motion) -> Motion:
        """Return what to command for this displacement to come about."""
        if not _long(wish):
            return wish
        return Motion(wish.x_m - self._ahead_m, wish.y_m - self._left_m, wish.yaw_rad)


def _long(motion: Motion) -> bool:
    return math.hypot(motion.x_m, motion.y_m) >= _LEAST_WAY_M
