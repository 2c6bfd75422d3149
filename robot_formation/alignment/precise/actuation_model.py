"""What a follower learns of its own drive from its moves: how short corrections fall, and how it slips aside."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot_formation.alignment.precise.pose_filter import FilterParameters
from robot_formation.alignment.precise.step_models import Drives
from robot_formation.geometry.se2 import Motion, into_frame
from robot_formation.parameters import parameter

# All chosen; docs/explanation/alignment.md ("Constants") says how far runs depend on them.
_LEAST_DRIVE_M = 0.02
"""A shorter drive ahead teaches nothing of slip and overshoot."""
_LONGEST_BESIDE_M = 0.02
"""Nor does one with a longer leg aside: the leg's own error would count as slip."""
_FORGETTING = 0.85
"""Weight of a drive after one more, in the least squares for slip: some seven drives count."""
_SLIP_SIGMA, _BESIDE_SIGMA_M = 0.05, 0.002
"""Standard deviations before any drive: of the slip, share of the way; of a leg aside's error in length."""
_LEAST_NOISE_M = 1e-6
"""A measured way aside is never taken for more exact: least squares of exact data end in 0 / 0."""
_OVERSHOOT_GAIN = 0.4
"""Share of a drive's overshoot in the running mean."""
_MOST_OVERSHOOT = 0.5
"""Bound on one drive's overshoot, either way, share of its length: more is no slope but a push or an obstacle."""
_SHORT_DRIVE_M = 0.06
"""Up to this length a leg is asked for longer, by what such legs lately fell short; longer ones are asked for as they
are."""
_NO_LEG_M = 1e-6
"""Up to here a component is what rounding leaves of a leg that wasn't asked for."""
MOST_COMPENSATION_M = 0.006
"""Bound on what is added to a leg; the planner leaves room for it."""
_SHORT_GAIN = 0.5
"""Share of a leg's shortfall in the running mean."""


@dataclass(frozen=True)
class ActuationParameters:
    """What the actuation model knows of the drive beforehand."""

    least_leg_m: float = parameter(
        0.0022,
        "Leg aside up to which the drive doesn't turn its wheels: what it coasts, -u[0] / u[1] of drive.calibration",
        unit="m",
        low=0.0,
        high=0.1,
    )
    wheel_lever_m: float = parameter(
        0.205, "Way of the wheels per radian of a turn: drive.wheel_lever_m", unit="m", low=0.0, high=10.0
    )


class ActuationModel:
    """Running means over the latest moves.

    Attributes:
        overshoot: how much farther than asked for the robot drives ahead, share of the way: it does so downhill.
        drives: how many drives ahead it knows.
    """

    def __init__(self, parameters: ActuationParameters, noise_m: float = FilterParameters.move_floor_m) -> None:
        """Know of no drive yet.

        Args:
            parameters: of the drive.
            noise_m: standard deviation of a drive's measured way aside.
        """
        self._p = parameters
        self._noise_m = max(noise_m, _LEAST_NOISE_M)
        self.overshoot = 0.0
        self.drives = 0
        self._aside = np.zeros(2)  # slip, and how far legs aside go beside what was asked for [m]
        self._covariance = np.diag([_SLIP_SIGMA**2, _BESIDE_SIGMA_M**2])
        self._wanted: Motion | None = None
        self._short: dict[tuple[str, bool], float] = {}

    @property
    def drives_so_far(self) -> Drives:
        """What is known of own drives."""
        return Drives(self.slip, self.overshoot, self.drives)

    @property
    def slip(self) -> float:
        """Way aside (to the left) per way of the wheels ahead and in turns, where none was asked for."""
        return float(self._aside[0])

    def compensated(self, motion: Motion) -> Motion:
        """Ask for as much more as corrections of this axis and direction have lately fallen short by."""
        self._wanted = motion
        turn, forward, left = motion.legs
        return Motion.from_legs(turn, self._longer("v", forward), self._longer("u", left))

    def moved(self, asked: Motion, motion: Motion) -> None:
        """Process a move: as commanded and as measured."""
        turn = asked.yaw_rad
        sent, got = into_frame(asked.x_m, asked.y_m, turn), into_frame(motion.x_m, motion.y_m, turn)
        if self._wanted is not None:
            wanted = into_frame(self._wanted.x_m, self._wanted.y_m, turn)
            for axis, want, a, b in zip("vu", wanted, sent, got, strict=True):
                self._learn(axis, want, (a - b) * math.copysign(1.0, want))
            self._wanted = None
        if sent[0] > _LEAST_DRIVE_M and got[0] > _LEAST_DRIVE_M and abs(sent[1]) < _LONGEST_BESIDE_M:
            self._learn_drive(sent, got, self._p.wheel_lever_m * abs(turn))

    def _learn_drive(self, sent: tuple[float, float], got: tuple[float, float], turning_m: float) -> None:
        """Learn from a drive ahead: recursive least squares with forgetting for what it leads aside."""
        overshoot = max(-_MOST_OVERSHOOT, min(_MOST_OVERSHOOT, got[0] / sent[0] - 1.0))
        self.overshoot += (_OVERSHOOT_GAIN if self.drives else 1.0) * (overshoot - self.overshoot)
        self.drives += 1
        # A leg shorter than the robot's coasting is not driven at all.
        driven = abs(sent[1]) > self._p.least_leg_m
        regressor = np.array([got[0] + turning_m, 1.0 if driven else 0.0])
        beside = got[1] - (sent[1] if driven else 0.0)
        spread = self._covariance @ regressor
        gain = spread / (self._noise_m**2 + regressor @ spread)
        self._aside = self._aside + gain * (beside - regressor @ self._aside)
        # Joseph's form, made symmetric: with forgetting, whatever rounding makes asymmetric or negative grows by 18 %
        # with each drive, and a shorter form ended in NaN after 150 to 300 drives.
        kept = np.eye(2) - np.outer(gain, regressor)
        covariance = (kept @ self._covariance @ kept.T + self._noise_m**2 * np.outer(gain, gain)) / _FORGETTING
        covariance = 0.5 * (covariance + covariance.T)
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
            self._short[axis, want > 0.0] = max(0.0, min(MOST_COMPENSATION_M, mean))
