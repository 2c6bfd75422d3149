"""Closing of residual and bias, and the mixture of models: against textbooks, by hand, and on a simulated follower."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from predictor_helpers import HISTORY, predictor, timesteps, whole
from robot_formation.koopman.predictors import NAMES, PredictorParameters
from robot_formation.koopman.predictors.closing import Closing, ResidualFilter
from robot_formation.koopman.predictors.models import NU, Previous
from robot_formation.koopman.predictors.parameters import ClosingParameters
from robot_formation.koopman.predictors.predictor import Predictor
from robot_formation.koopman.predictors.spatial import Spatial
from robot_formation.parameters import ParameterError

Array = npt.NDArray[np.float64]

CLOSING = [name for name in NAMES if name.endswith("+close") or name == "formation"]


class Textbook:
    """Kalman filter of (r, w, trend) of one axis in the usual matrices, with the loss of each of its innovations."""

    def __init__(self, p: ClosingParameters, axis: int, noise_m: float, level_m: float, trend_m: float) -> None:
        step = (p.step_u_m, p.step_v_m)[axis]
        sigmas = ((p.start_u_m, p.step_sigma_u_m), (p.start_v_m, p.step_sigma_v_m))[axis]
        self.x = np.array([0.0, step, 0.0])
        self.p = np.diag(np.square([*sigmas, p.trend_start_m]))
        self.camera = (p.residual_u_m, p.residual_v_m)[axis] ** 2
        self.d = p.trend_damping
        self.q_residual = np.diag([noise_m**2, 0.0, 0.0])
        self.q_step = np.diag([0.0, level_m**2, trend_m**2])

    def observe(self, total: float, residual: float | None) -> float | None:
        """Move on by a timestep; return the loss, None if there was no measurement."""
        f = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        self.x = f @ self.x - np.array([total, 0.0, 0.0])
        self.p = f @ self.p @ f.T + self.q_residual
        loss, h = None, np.array([[1.0, 0.0, 0.0]])
        if residual is not None:
            s = (h @ self.p @ h.T)[0, 0] + self.camera
            innovation = residual - (h @ self.x)[0]
            gain = (self.p @ h.T / s)[:, 0]
            self.x = self.x + gain * innovation
            self.p = (np.eye(3) - np.outer(gain, h)) @ self.p
            loss = (NU + 1.0) * np.log(1.0 + innovation**2 / (NU * s)) + np.log(s)
        f = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, self.d], [0.0, 0.0, self.d]])
        self.x, self.p = f @ self.x, f @ self.p @ f.T + self.q_step
        return loss


def test_one_filter_of_the_bank_is_the_textbooks_kalman_filter() -> None:
    p = ClosingParameters(noise_m=(0.002,), level_m=(0.001,), trend_m=(0.0005,))
    bank, books = ResidualFilter(p), [Textbook(p, axis, 0.002, 0.001, 0.0005) for axis in (0, 1)]
    for x, r, _ in timesteps(40):
        x, r = x[:2], None if r is None else r[:2]
        bank.observe(x, r)
        for axis in (0, 1):
            books[axis].observe(x[axis], None if r is None else r[axis])
            assert bank.residual[axis] == pytest.approx(books[axis].x[0], abs=1e-14)
            assert bank.step[axis] == pytest.approx(books[axis].x[1], abs=1e-14)
    assert (bank.weights == 1.0).all()


def test_the_bank_is_weighted_by_the_discounted_likelihood_of_its_innovations() -> None:
    p = ClosingParameters()
    settings = list(zip(p.noise_m, p.level_m, p.trend_m, strict=True))
    bank = ResidualFilter(p)
    books = [[Textbook(p, axis, *setting) for axis in (0, 1)] for setting in settings]
    losses = np.zeros((len(settings), 2))
    for x, r, _ in timesteps(40, seed=1):
        x, r = x[:2], None if r is None else r[:2]
        bank.observe(x, r)
        found = np.array(
            [[book.observe(x[i], None if r is None else r[i]) for i, book in enumerate(pair)] for pair in books],
            dtype=float,
        )
        if r is not None:
            losses = p.discount * losses + found
        weights = np.exp(-0.5 * losses)
        weights /= weights.sum(axis=0)
        assert bank.weights == pytest.approx(weights, abs=1e-12)
        for part, index in ((bank.residual, 0), (bank.step, 1)):
            values = np.array([[book.x[index] for book in pair] for pair in books])
            assert part == pytest.approx((weights * values).sum(axis=0), abs=1e-13)


def test_the_steady_filter_wins_on_a_steady_leader_and_the_nervous_one_on_one_that_jumps() -> None:
    rng = np.random.default_rng(0)
    steady, jumping = ResidualFilter(ClosingParameters()), ResidualFilter(ClosingParameters())
    for _ in range(40):
        steady.observe(np.array([0.0, 0.05]), rng.normal(0.0, (0.006, 0.001)))
        jump = rng.normal(0.0, 0.02, 2)
        jumping.observe(np.array([0.0, 0.05]), jump)
    assert (steady.weights.argmax(axis=0) == 0).all()
    assert (jumping.weights.argmax(axis=0) == 2).all()


def test_the_bank_needs_three_numbers_for_each_filter() -> None:
    for wrong in ({"noise_m": (0.001, 0.002)}, {"noise_m": (), "level_m": (), "trend_m": ()}):
        with pytest.raises(ParameterError, match="one number for each filter"):
            ClosingParameters(**wrong)


# --- closing --------------------------------------------------------------------------------------------------------


def closing(**values: Any) -> Closing:
    parameters = PredictorParameters()
    return Closing(ClosingParameters(**values), Spatial(Previous(parameters), Previous(parameters, 1)))


def test_without_any_residual_displacements_are_all_there_is() -> None:
    tested = closing()
    for x in HISTORY:
        tested.observe(whole(x), None, None)
        assert (tested.forecast() == whole(x)).all()
    assert (tested.bias() == 0.0).all()


def test_a_residual_that_is_unknown_now_and_then_is_carried_on_by_what_was_driven() -> None:
    tested = closing(residual_u_m=1e-5, residual_v_m=1e-5)
    w = np.array([0.0, 0.05, 0.0])
    for _ in range(30):
        tested.observe(w, np.zeros(3), None)
    missed = np.array([0.0, 0.01, 0.0])
    tested.observe(w - missed, None, None)  # nobody saw that it fell short
    assert tested.forecast() == pytest.approx(w + missed, abs=1e-4)


def test_moves_that_ended_far_from_their_command_teach_no_bias() -> None:
    tested = closing()
    tested.observe(whole((0.0, 0.05)), None, np.zeros(3))
    assert (tested.bias() == 0.0).all()
    tested.observe(whole((0.0, 0.05)), None, whole((0.0, 0.045)))
    assert tested.bias()[0] == 0.0
    assert 0.0 < tested.bias()[1] < 0.005


def follow(
    found: Predictor, bias: Array, w: Array, count: int, rng: np.random.Generator, noise_m: float = 0.001
) -> Array:
    """A follower that obeys its predictor, with a constant bias; returns the true residuals."""
    command, r, residuals = np.array([0.0, 0.05]), np.zeros(2), []
    for _ in range(count):
        total = command + bias + rng.normal(0.0, noise_m, 2)
        r = r + w - total
        found.observe(whole(total), whole(r + rng.normal(0.0, (0.006, 0.001))), whole(command))
        command = found.predict().command[:2]
        residuals.append(r)
    return np.array(residuals)


@pytest.mark.parametrize("name", CLOSING)
def test_a_constant_bias_is_learned_and_the_leaders_step_found_and_no_residual_is_left(name: str) -> None:
    bias, w = np.array([-0.004, 0.003]), np.array([0.008, 0.047])
    found = predictor(name)
    residuals = follow(found, bias, w, 80, np.random.default_rng(5))
    forecast = found.predict()
    assert (forecast.mean - forecast.command)[:2] == pytest.approx(bias, abs=0.001)
    assert np.abs(residuals[40:].mean(axis=0)).max() < 0.0015
    assert np.abs(residuals[40:]).max() < 0.012


def test_the_forecast_is_that_of_the_model_plus_the_filtered_residual() -> None:
    p = ClosingParameters()
    tested, alone, model = closing(), ResidualFilter(p), Previous(PredictorParameters())
    for x, r, c in timesteps(30):
        r = np.zeros(3) if r is None else r
        tested.observe(x, r, c)
        alone.observe(x[:2], r[:2])
        model.observe(alone.step)
        assert (tested.forecast()[:2] == model.forecast() + alone.residual).all()
