"""The curve fit recovers what the drives were made from, and chooses the degree by the drives' scatter."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from robot_formation.calibration.motor_fit import MeasuredDrive, fit_axis
from robot_formation.drive.curves import CalibrationError

DISTANCES = np.array([0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2])


def drives(
    curve: Sequence[float],
    *,
    repeats: int = 2,
    scatter: float = 0.0,
    seed: int = 0,
    distances: NDArray[np.float64] = DISTANCES,
) -> list[MeasuredDrive]:
    """Forth and back over the rotations of a known curve; the travel scatters."""
    noise = np.random.default_rng(seed)
    rotations = Polynomial(curve)(distances)
    return [
        MeasuredDrive(sense * rotation, sense * (distance + scatter * noise.standard_normal()))
        for _ in range(repeats)
        for rotation, distance in zip(rotations, distances, strict=True)
        for sense in (1, -1)
    ]


@pytest.mark.parametrize("curve", [(-0.08, 33.0), (-0.08, 31.0, 12.0), (-0.1, 30.0, 25.0, -60.0)])
def test_a_known_curve_is_recovered_with_its_degree(curve: Sequence[float]) -> None:
    fit = fit_axis("v", drives(curve))
    assert fit.curve == pytest.approx(curve, rel=1e-8)
    assert fit.residual_max < 1e-12
    assert fit.scatter < 1e-12


@given(constant=st.floats(-0.2, -0.01), slope=st.floats(25.0, 50.0))
def test_any_line_is_recovered(constant: float, slope: float) -> None:
    fit = fit_axis("v", drives((constant, slope)))
    assert fit.curve == pytest.approx((constant, slope), rel=1e-9)


def test_scatter_alone_does_not_raise_the_degree() -> None:
    degrees = [fit_axis("v", drives((-0.08, 33.0), repeats=5, scatter=0.0015, seed=seed)).degree for seed in range(200)]
    assert degrees.count(1) >= 190  # refused at 1 %


def test_a_bend_beyond_the_scatter_raises_the_degree() -> None:
    bent = (-0.08, 28.0, 25.0)
    assert [fit_axis("v", drives(bent, repeats=5, scatter=0.0015, seed=s)).degree for s in range(20)] == [2] * 20


def test_residuals_scatter_and_counts_are_those_of_the_drives() -> None:
    made = drives((-0.08, 33.0), repeats=50, scatter=0.0015)
    fit = fit_axis("v", made)
    assert fit.scatter == pytest.approx(0.0015, rel=0.05)
    assert [point.drives for point in fit.points] == [100] * len(DISTANCES)
    for point in fit.points:
        by_curve = (Polynomial(fit.curve) - point.rotation_rad).roots()[0]
        assert point.residual == pytest.approx(point.travel - by_curve, abs=1e-9)
    assert fit.residual_rms == pytest.approx(np.sqrt(np.mean([p.residual**2 for p in fit.points])))


def test_a_line_of_the_means_is_the_least_squares_line() -> None:
    fit = fit_axis("v", drives((-0.08, 33.0), scatter=0.001), degrees=(1,))
    travels, rotations = zip(*((p.travel, p.rotation_rad) for p in fit.points), strict=True)
    slope, constant = np.polyfit(travels, rotations, 1)
    assert fit.curve == pytest.approx((constant, slope))


def test_too_few_rotations_and_drives_that_bring_nothing_are_refused() -> None:
    with pytest.raises(CalibrationError, match="too few"):
        fit_axis("v", drives((-0.08, 33.0), distances=DISTANCES[:4]))
    stuck = [MeasuredDrive(rotation, 0.01) for rotation in (1.0, 2.0, 3.0, 4.0, 5.0)]
    with pytest.raises(CalibrationError, match="blocked"):
        fit_axis("v", stuck)
    backwards = [MeasuredDrive(drive.rotation_rad, -drive.travel) for drive in drives((-0.08, 33.0))]
    with pytest.raises(CalibrationError, match="blocked"):
        fit_axis("v", backwards)
