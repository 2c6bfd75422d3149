"""The predictor on messages: one prediction per timestep, once both halves of its report are there."""

import math

import numpy as np
import pytest
from component_helpers import wired

from robot_formation import conversions
from robot_formation.control.motion import Motion
from robot_formation.koopman.predictors import Predictor, PredictorParameters


def report(motion, stamp_ns):
    """A displacement and the residual with the same stamp."""
    base = "follower_1/base_link"
    return conversions.displacement(motion, base, stamp_ns), conversions.displacement(Motion(), base, stamp_ns)


@pytest.fixture
def wire():
    return wired("predictor", "follower_1")


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["displacement first", "residual first"])
def test_it_answers_when_both_halves_are_there_whichever_comes_first(wire, order):
    halves = [("displacement", "residual")[i] for i in order]
    messages = [report(Motion.from_uv(0.012, 0.05), 100)[i] for i in order]
    assert wire.give(halves[0], messages[0]) == []
    ((topic, message),) = wire.give(halves[1], messages[1])
    assert topic == "prediction"
    assert conversions.stamp_of(message) == 100
    assert message.header.frame_id == "follower_1/base_link"
    found = conversions.read_displacement(message)
    assert (found.u_m, found.v_m) == (0.012, 0.05)


def test_halves_of_different_timesteps_are_no_pair(wire):
    assert wire.give("displacement", report(Motion(0.05), 100)[0]) == []
    assert wire.give("residual", report(Motion(0.05), 200)[1]) == []
    assert wire.component.details()["timesteps"] == "0"
    assert len(wire.give("residual", report(Motion(0.05), 100)[1])) == 1
    assert len(wire.give("displacement", report(Motion(0.06), 200)[0])) == 1


def test_a_residual_that_was_not_seen_is_half_of_a_pair_too(wire):
    displacement, _ = report(Motion(0.05), 7)
    unseen = conversions.displacement(Motion(), "follower_1/base_link", 7, conversions.NO_ESTIMATE)
    wire.give("displacement", displacement)
    assert len(wire.give("residual", unseen)) == 1


def test_predictions_and_covariances_are_the_models_own_with_u_and_v_turned_into_x_and_y():
    wire = wired("predictor", "follower_1", name="measured")
    model = Predictor(PredictorParameters(name="measured"))
    history = [(0.010, 0.050), (0.012, 0.049), (0.015, 0.051), (0.017, 0.047), (0.021, 0.048)]
    for stamp_ns, (u, v) in enumerate(history):
        displacement, residual = report(Motion.from_uv(u, v), stamp_ns)
        wire.give("displacement", displacement)
        ((_, message),) = wire.give("residual", residual)
        model.observe(u, v)
        forecast = model.predict()
        found = conversions.read_displacement(message)
        assert (found.u_m, found.v_m) == tuple(forecast.mean)
        xy = np.reshape(message.pose.covariance, (6, 6))[:2, :2]
        uu, uv, vv = forecast.covariance[0, 0], forecast.covariance[0, 1], forecast.covariance[1, 1]
        assert xy == pytest.approx(np.array([[vv, -uv], [-uv, uu]]), abs=1e-20)
    details = wire.component.details()
    assert details["timesteps"] == "5"
    assert {"K", "eigenvalues", "innovation [m]", "condition number"} <= set(details)
    assert not any("\n" in value for value in details.values())


def test_a_displacement_that_is_refused_is_warned_of_and_still_answered_from_what_is_known(wire):
    for message, topic in zip(report(Motion(0.05, 0.01), 1), ("displacement", "residual"), strict=True):
        wire.give(topic, message)
    displacement, residual = report(Motion(math.nan, 0.0), 2)
    wire.give("displacement", displacement)
    ((_, message),) = wire.give("residual", residual)
    assert conversions.read_displacement(message) == Motion(0.05, 0.01)
    assert conversions.stamp_of(message) == 2
    assert "not finite" in wire.warnings[0]
    assert wire.component.details()["timesteps"] == "1"


def test_with_nothing_known_at_all_the_answer_says_that_it_is_no_estimate(wire):
    displacement, residual = report(Motion(math.nan, 0.0), 2)
    wire.give("displacement", displacement)
    ((_, message),) = wire.give("residual", residual)
    assert not conversions.has_estimate(message)
    assert len(wire.warnings) == 2
