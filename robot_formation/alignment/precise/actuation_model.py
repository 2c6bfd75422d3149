"""What a follower learns of its own drive from its moves: how short corrections fall, and how it slips aside."""

from __future__ import annotations

import math

import numpy as np

from robot_formation.geometry.se2 import Motion, into_frame

_LEAST_DRIVE_M = 0.02
_LEAST_LEG_M = 0.0022
_LONGEST_BESIDE_M = 0.02
_FORGETTING = 0.85
_SLIP_SIGMA, _BESIDE_SIGMA_M, _NOISE_M = 0.05, 0.002, 0.0007
_OVERSHOOT_GAIN = 0.4
_MOST_OVERSHOOT = 0.5
_SHORT_DRIVE_M = 0.06
_NO_LEG_M = 1e-6
"""Up to here a component is what rounding leaves of a leg that wasn't asked for."""
_MOST_SHORT_M = 0.006
_SHORT_GAIN = 0.5


class ActuationModel:
    """Running means over the latest moves.

    Attributes:
        overshoot: how much farther than asked for the robot drives ahead, share of the way: it does so downhill.
        drives: how many drives ahead it knows.
    """

    def __init__(self) -> None:
        self.overshoot = 0.0
        self.drives = 0
        self._aside = np.zeros(2)  # slip, and how far legs aside go beside what was asked for [m]
        self._covariance = np.diag([_SLIP_SIGMA**2, _BESIDE_SIGMA_M**2])
        self._wanted: Motion | None = None
        self._short: dict[tuple[str, bool], float] = {}

    @property
    def slip(self) -> float:
        """Way aside (to the left) per way ahead, where none was asked for."""
        return float(self._aside[0])

    def compensated(self, motion: Motion) -> Motion:
        """Ask for as much more as corrections of this axis and direction have lately fallen short by."""
        self._wanted = motion
        turn, forward, left = motion.legs
        return Motion.from_legs(turn, self._longer("v", forward), self._longer("u", left))

    def moved(self, asked: Motion, motion: Motion) -> None:
        """Take a move as it was asked for and as it was measured."""
        turn = asked.yaw_rad
        sent, got = into_frame(asked.x_m, asked.y_m, turn), into_frame(motion.x_m, motion.y_m, turn)
        if self._wanted is not None:
            wanted = into_frame(self._wanted.x_m, self._wanted.y_m, turn)
            for axis, want, a, b in zip("vu", wanted, sent, got, strict=True):
                self._learn(axis, want, (a - b) * math.copysign(1.0, want))
            self._wanted = None
        if sent[0] > _LEAST_DRIVE_M and got[0] > _LEAST_DRIVE_M and abs(sent[1]) < _LONGEST_BESIDE_M:
            self._learn_drive(sent, got)

    def _learn_drive(self, sent: tuple[float, float], got: tuple[float, float]) -> None:
        """Learn from a drive ahead: recursive least squares with forgetting for what it leads aside."""
        overshoot = max(-_MOST_OVERSHOOT, min(_MOST_OVERSHOOT, got[0] / sent[0] - 1.0))
        self.overshoot += (_OVERSHOOT_GAIN if self.drives else 1.0) * (overshoot - self.overshoot)
        self.drives += 1
        # A leg shorter than the robot's coasting is not driven at all.
        driven = abs(sent[1]) > _LEAST_LEG_M
        regressor = np.array([got[0], 1.0 if driven else 0.0])
        beside = got[1] - (sent[1] if driven else 0.0)
        spread = self._covariance @ regressor
        gain = spread / (_NOISE_M**2 + regressor @ spread)
        self._aside = self._aside + gain * (beside - regressor @ self._aside)
        covariance = (self._covariance - np.outer(gain, spread)) / _FORGETTING
        # Not less certain than at the start: without legs aside, forgetting alone would wind the covariance up.
        most = np.array([_SLIP_SIGMA, _BESIDE_SIGMA_M])
        scale = np.minimum(1.0, most / np.sqrt(np.diag(covariance)))
        self._covariance = covariance * np.outer(scale, scale)

    def _longer(self, axis: str, length: float) -> float:
        if not _NO_LEG_M < abs(length) < _SHORT_DRIVE_M:
            return length
        return length + math.copysign(self._short.get((axis, length > 0.0), 0.0), length)

    def _learn(self, axis: str, want: float, missing: float) -> None:
        if _NO_LEG_M < abs(want) < _SHORT_DRIVE_M:
            known = self._short.get((axis, want > 0.0), 0.0)
            mean = known + _SHORT_GAIN * (missing - known)
            self._short[axis, want > 0.0] = max(0.0, min(_MOST_SHORT_M, mean))
