"""Forecasts' ellipses, and words."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_formation.analysis.quantiles import ELLIPSE_90
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import Motion
from robot_formation.viewing.moment import FollowerNow, Forecast, TimestepFigures, figures_in_words


@given(
    yaw=st.floats(-3.0, 3.0),
    sigma_u=st.floats(1e-3, 0.1),
    sigma_v=st.floats(1e-3, 0.1),
    correlation=st.floats(-0.9, 0.9),
)
def test_every_point_of_the_ellipse_has_the_mahalanobis_distance_of_90_percent(
    yaw: float, sigma_u: float, sigma_v: float, correlation: float
) -> None:
    uv = correlation * sigma_u * sigma_v
    forecast = Forecast(Motion(1.0, 2.0, yaw), Motion.from_uv(0.01, 0.05), (sigma_u**2, uv, sigma_v**2))
    inverse = np.linalg.inv(np.array([[sigma_u**2, uv], [uv, sigma_v**2]]))
    for x_m, y_m in forecast.ellipse(12).tolist():
        told = Motion(x_m, y_m).relative_to(forecast.start)
        away = np.array([told.u_m - 0.01, told.v_m - 0.05])
        assert away @ inverse @ away == pytest.approx(ELLIPSE_90, rel=1e-6)


def test_an_exact_forecast_is_one_place() -> None:
    forecast = Forecast(Motion(1.0, 2.0, math.pi / 2), Motion(0.05, 0.0), (0.0, 0.0, 0.0))
    assert np.allclose(forecast.ellipse(), (1.0, 2.05))


@pytest.mark.parametrize("state", list(AlignmentState))
def test_there_are_words_for_every_state_and_its_reason(state: AlignmentState) -> None:
    assert FollowerNow(state.format()).words != state.value
    assert FollowerNow(state.format("because")).words.endswith("(because)")


def test_words_of_others_are_kept() -> None:
    assert FollowerNow("my own state").words == "my own state"
    assert FollowerNow().words == "has not begun"


def test_figures_that_are_unknown_are_left_out() -> None:
    assert figures_in_words([]) == ""
    assert figures_in_words([TimestepFigures(3, 0.012, 0.0034)]) == (
        "timestep 3: formation error 0.34 cm, correction 1.2 cm"
    )
    assert figures_in_words([TimestepFigures(3, None, None)]) == "timestep 3 is finished"
