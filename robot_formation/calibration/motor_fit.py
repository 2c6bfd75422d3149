"""From measured drives to a calibration curve: wheel rotation as a polynomial of the distance driven."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy import stats

from robot_formation.drive.curves import CalibrationError, Curve

Floats = NDArray[np.float64]

DEGREES = (1, 2, 3)
_SIGNIFICANCE = 0.01
"""Share of true curves that the test for lack of fit refuses."""
_NEGLIGIBLE = 1e-6
"""A difference in travel (m or rad) that no observer can tell; keeps rounding errors from choosing the degree."""


@dataclass(frozen=True)
class MeasuredDrive:
    """One drive over a preset wheel rotation [rad], as the observer measured it: travel in m (turns: rad).

    Both have the same sign, that of the drive's sense.
    """

    rotation_rad: float
    travel: float


@dataclass(frozen=True)
class FittedPoint:
    """All drives over one wheel rotation, either sense: mean travel, scatter of one drive, mean minus curve."""

    rotation_rad: float
    drives: int
    travel: float
    scatter: float
    residual: float


@dataclass(frozen=True)
class AxisFit:
    """The curve of one robot's axis and what it is worth; travels in metres, those of 'turn' in radians.

    Attributes:
        axis: v, u or turn.
        curve: coefficients of the wheel rotation [rad], constant term first.
        points: the measured rotations, ascending.
        lack_of_fit: by degree tried, how much larger the residuals are than the scatter of repeated drives explains,
            as a standard normal deviate.
    """

    axis: str
    curve: Curve
    points: tuple[FittedPoint, ...]
    lack_of_fit: Mapping[int, float]

    @property
    def degree(self) -> int:
        """Degree of the curve."""
        return len(self.curve) - 1

    @property
    def residual_rms(self) -> float:
        """RMS of the points' residuals."""
        return float(np.sqrt(np.mean([point.residual**2 for point in self.points])))

    @property
    def residual_max(self) -> float:
        """Largest residual in size."""
        return max(abs(point.residual) for point in self.points)

    @property
    def scatter(self) -> float:
        """Standard deviation of a single drive about its rotation's mean, pooled over the rotations; 0 if unknown."""
        freedom = sum(point.drives - 1 for point in self.points)
        return float(np.sqrt(sum((p.drives - 1) * p.scatter**2 for p in self.points) / freedom)) if freedom else 0.0


def fit_axis(axis: str, drives: Iterable[MeasuredDrive], degrees: Sequence[int] = DEGREES) -> AxisFit:
    """Fit wheel rotation on mean travel by least squares; the curve is odd, so both senses count alike.

    Rotations are exact and travels scatter, yet the drive needs rotation by travel; the means of several drives are
    so much more exact than their spread that the fit may take them as given. Degree: the lowest that the test for
    lack of fit doesn't refuse at 1 %, which compares the means' residuals with the scatter of repeated drives; the
    highest if it refuses all.

    Raises:
        CalibrationError: if there are too few rotations, or a longer rotation didn't bring the robot farther.
    """
    groups: dict[float, list[float]] = {}
    for drive in drives:
        groups.setdefault(abs(drive.rotation_rad), []).append(drive.travel if drive.rotation_rad > 0 else -drive.travel)
    rotations = np.array(sorted(groups))
    travels = np.array([np.mean(groups[rotation]) for rotation in rotations])
    _check(axis, rotations, travels, max(degrees) + 2)
    fits = {degree: _fit(axis, degree, rotations, travels, groups) for degree in sorted(degrees)}
    tests = {degree: _lack_of_fit(fit) for degree, fit in fits.items()}
    refused = stats.norm.isf(_SIGNIFICANCE)
    degree = next((degree for degree, deviate in tests.items() if deviate <= refused), max(fits))
    return replace(fits[degree], lack_of_fit=tests)


def _check(axis: str, rotations: Floats, travels: Floats, needed: int) -> None:
    if len(rotations) < needed:
        raise CalibrationError(
            f"{axis}: {len(rotations)} wheel rotations are too few to fit a curve; measure at least {needed}"
        )
    if travels[0] <= 0.0 or np.any(np.diff(travels) <= 0.0):
        raise CalibrationError(
            f"{axis}: longer wheel rotations didn't bring the robot farther; is it blocked, or the noise too large "
            "for so few repeats?"
        )


def _fit(axis: str, degree: int, rotations: Floats, travels: Floats, groups: Mapping[float, list[float]]) -> AxisFit:
    curve = Polynomial.fit(travels, rotations, degree)
    # Travel measured minus travel by the curve, to first order in the difference.
    residuals = (curve(travels) - rotations) / curve.deriv()(travels)
    points = []
    for rotation, travel, residual in zip(rotations, travels, residuals, strict=True):
        group = groups[rotation]
        scatter = float(np.std(group, ddof=1)) if len(group) > 1 else 0.0
        points.append(FittedPoint(float(rotation), len(group), float(travel), scatter, float(residual)))
    coefficients = np.zeros(degree + 1)
    found = curve.convert().coef
    coefficients[: len(found)] = found  # numpy drops leading zeros
    return AxisFit(axis, tuple(float(c) for c in coefficients), tuple(points), {})


def _lack_of_fit(fit: AxisFit) -> float:
    """F of residuals against the scatter of repeated drives, as the standard normal deviate of equal probability."""
    between = len(fit.points) - len(fit.curve)
    within = sum(point.drives - 1 for point in fit.points)
    if within == 0:
        return 0.0  # nothing was repeated: residuals can't be judged
    variance = fit.scatter**2 + _NEGLIGIBLE**2
    ratio = sum(point.drives * point.residual**2 for point in fit.points) / between / variance
    chance = stats.f.sf(ratio, between, within)
    # Probabilities that round to 0 or 1 have no finite deviate; the report is JSON, which has no infinity.
    return float(stats.norm.isf(np.clip(chance, np.finfo(float).tiny, 1.0 - np.finfo(float).eps)))
