"""The project's own predictor: oscillators against the sequences they describe, aggregation against its bounds."""

import json
import math

import numpy as np
import numpy.typing as npt
import pytest

from cases import case
from predictor_helpers import predictor
from robot_formation.koopman.predictors import Ahead, PredictionError, Predictor, PredictorParameters
from robot_formation.koopman.predictors.aggregation import ExponentialWeights, MlPoly
from robot_formation.koopman.predictors.filter_bank import FilterBank, conditioned
from robot_formation.koopman.predictors.oscillators import PriorKnowledge, oscillators, periods_of, trends, turning
from robot_formation.koopman.predictors.parameters import ClosingParameters, OscillatorParameters

Array = npt.NDArray[np.float64]

EXACT = np.full(3, 1e-10)


def circle(count: int, period: float) -> Array:
    """Steps of 5 cm whose direction turns evenly, (count, 3); the first one is straight ahead."""
    angles = 2.0 * math.pi * np.arange(count) / period
    return np.stack([0.05 * np.sin(angles), 0.05 * np.cos(angles), np.zeros(count)], axis=1)


def pulse(count: int, period: float) -> Array:
    """Steps forward that grow and shrink about 3 cm, (count, 3)."""
    angles = 2.0 * math.pi * np.arange(count) / period
    return np.stack([np.zeros(count), 0.03 + 0.02 * np.cos(angles), np.zeros(count)], axis=1)


def test_a_blind_timestep_teaches_nothing_of_a_turn_that_was_never_seen() -> None:
    found = predictor(name="formation")
    for _ in range(5):
        found.observe(np.array([0.0, 0.05, 0.0]), np.array([0.0, 0.0, math.nan]))
    for _ in range(3):
        found.observe(np.array([0.0, 0.05, 0.05]), None)
    assert abs(float(found.predict().mean[2])) < 1e-3


def test_a_bank_weighs_only_the_filters_that_saw_something() -> None:
    known, p = PriorKnowledge(ClosingParameters()), OscillatorParameters()
    bank = FilterBank(turning(known, p, np.array([9.0, -9.0]), level=True), 0.9, 10)
    bank.observe(np.array([0.01, 0.05, 0.0]), np.array([0.01, 0.02, 0.0]), np.full(3, 1e-5))
    before = bank.losses
    bank.observe(np.array([0.0, 0.05, 0.0]), np.full(3, math.nan), np.full(3, 1e-5))
    assert (bank.losses == before).all()
    bank.observe(np.array([0.0, 0.05, 0.0]), np.array([0.01, math.nan, 0.0]), np.full(3, 1e-5))
    assert (bank.losses != before).all()


# --- filters --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("harmonics", [1, 2])
def test_an_oscillator_of_the_right_period_continues_its_sequence(harmonics: int) -> None:
    period, p = 11.0, OscillatorParameters(level_m=0.0, change_m=0.0, noise_m=1e-6)
    t = np.arange(60)
    w = 0.03 + 0.02 * np.cos(2.0 * math.pi * t / period + 0.4)
    if harmonics == 2:
        w += 0.01 * np.sin(4.0 * math.pi * t / period)
    known = PriorKnowledge(ClosingParameters(step_v_m=float(w[0])))
    bank = FilterBank(oscillators(known, 1, p, np.array([period]), harmonics), 0.95, 10)
    for value in w[:40]:
        bank.observe(np.array([0.0, value, 0.0]), np.zeros(3), EXACT)
    assert bank.ahead(20)[0, :, 0] == pytest.approx(w[40:60], abs=1e-4)


def test_a_turning_displacement_is_continued_after_two_timesteps() -> None:
    w = circle(20, -9.0)
    known = PriorKnowledge(ClosingParameters(step_v_m=0.05))
    bank = FilterBank(turning(known, OscillatorParameters(), np.array([9.0, -9.0]), level=False), 0.95, 10)
    for value in w[:2]:
        bank.observe(value, np.zeros(3), EXACT)
    right = int(np.argmin(bank.losses))
    assert right == 0  # u to the right of v: what turns clockwise for an eye above has a positive rotation here
    assert bank.ahead(5)[right] == pytest.approx(circle(20, 9.0)[2:7, :2] * [-1.0, 1.0], abs=3e-3)


def test_the_eigenvalues_of_oscillators_lie_on_the_unit_circle() -> None:
    p = OscillatorParameters()
    periods = periods_of(p)
    assert (periods[0], periods[-1], len(periods)) == (pytest.approx(p.longest), pytest.approx(p.shortest), p.count)
    for model in (
        oscillators(PriorKnowledge(ClosingParameters()), 0, p, periods, 2),
        turning(PriorKnowledge(ClosingParameters()), p, periods, level=True),
    ):
        assert np.abs(np.linalg.eigvals(model.onward)) == pytest.approx(1.0, abs=1e-12)


def test_the_likelihood_finds_the_period() -> None:
    p, known = OscillatorParameters(), PriorKnowledge(ClosingParameters(step_v_m=0.05))
    periods = periods_of(p)
    bank = FilterBank(oscillators(known, 1, p, periods, 1), p.discount, 10)
    rng = np.random.default_rng(1)
    for value in pulse(50, 14.0):
        seen = np.array([0.0, rng.normal(0.0, 0.001), 0.0])
        bank.observe(value + np.array([0.0, rng.normal(0.0, 0.0015), 0.0]), seen, known.camera)
    assert periods[np.argmin(bank.losses)] == pytest.approx(14.0, rel=0.05)


def test_what_nobody_saw_leaves_the_weights_and_moves_the_mean_by_the_model() -> None:
    p, known = OscillatorParameters(), PriorKnowledge(ClosingParameters())
    bank = FilterBank(trends(known, 1, [(0.0016, 0.0003, 0.002, 1.0, 0.002)]), 0.9, 10)
    for value in pulse(12, 14.0):
        bank.observe(value, np.zeros(3), known.camera)
    ahead, losses, residual = bank.ahead(2)[0, :, 0], bank.losses, bank.means[0, 0]
    bank.observe(np.zeros(3), np.full(3, np.nan), known.camera)
    assert (bank.losses == losses).all()
    assert bank.means[0, 0] == pytest.approx(residual + ahead[0])  # the neighbour went on, the robot did not
    assert bank.ahead(1)[0, 0, 0] == pytest.approx(ahead[1])
    assert p.count > 1


def test_conditioning_on_a_sum_gives_the_sum() -> None:
    mean, cov = conditioned(np.zeros(2), np.eye(2), np.ones(2), 1.0, 1e-9)
    assert mean == pytest.approx([0.5, 0.5])
    assert np.ones(2) @ cov @ np.ones(2) == pytest.approx(0.0, abs=1e-12)


# --- aggregation ----------------------------------------------------------------------------------------------------


def losses_of(aggregation: MlPoly | ExponentialWeights, forecasts: Array, values: Array) -> float:
    """Sum of the squared errors of the aggregate."""
    total = 0.0
    for row, value in zip(forecasts, values.tolist(), strict=True):
        assert aggregation.weights.sum() == pytest.approx(1.0)
        assert (aggregation.weights >= 0.0).all()
        total += float(aggregation.weights @ row - value) ** 2
        aggregation.observe(row, value)
    return total


def sequences(count: int) -> dict[str, tuple[Array, Array]]:
    """Experts' forecasts (count, 3) and values (count,), in units of the scale."""
    rng, t = np.random.default_rng(4), np.arange(count)
    signs: Array = np.where(t % 2, -1.0, 1.0)
    best = rng.integers(0, 3, count // 20 + 1).repeat(20)[:count]
    return {
        "one is right": (np.tile([0.0, 1.0, -2.0], (count, 1)) + rng.normal(0.0, 0.1, (count, 3)), np.zeros(count)),
        "alternating": (np.stack([signs, -signs, 0.0 * signs], axis=1), rng.normal(0.0, 0.3, count)),
        "against the leader": (np.stack([np.ones(count), -np.ones(count), 0.0 * t], axis=1), signs),
        "switching": (3.0 * (np.arange(3) != best[:, None]), np.zeros(count)),
    }


def test_ml_poly_is_never_much_worse_than_the_best_expert() -> None:
    """The bound of the paper's corollary for losses in [0, E]: regret at most of the order of E sqrt(T log K) + E."""
    count = 300
    for name, (forecasts, values) in sequences(count).items():
        with case(name):
            found = losses_of(MlPoly(np.full(3, 1.0 / 3.0), 1.0), forecasts, values)
            each = ((forecasts - values[:, None]) ** 2).sum(axis=0)
            largest = float(
                np.abs(2.0 * (forecasts.max() - forecasts.min()) * (np.abs(forecasts).max() + np.abs(values).max()))
            )
            assert found <= each.min() + largest * (1.0 + math.sqrt(count * math.log(3.0)))
    forecasts, values = sequences(count)["one is right"]
    assert losses_of(MlPoly(np.full(3, 1.0 / 3.0), 1.0), forecasts, values) < 15.0  # constant, not growing with time


def test_exponential_weights_go_to_the_best_expert_and_leave_one_that_fails() -> None:
    tested = ExponentialWeights(np.array([0.8, 0.2]), 1.0, 0.9)
    assert tested.weights == pytest.approx([0.8, 0.2])
    for _ in range(20):
        tested.observe(np.array([3.0, 0.0]), 0.0)
    assert tested.weights[1] > 0.99
    for _ in range(20):
        tested.observe(np.array([0.0, 3.0]), 0.0)
    assert tested.weights[0] > 0.99


# --- the whole predictor --------------------------------------------------------------------------------------------


def follow(found: Predictor, w: Array, seed: int = 0, blind: tuple[int, ...] = ()) -> Array:
    """Errors (n, 3) of the forecasts along a leader's steps (n, 3) of a follower that obeys them."""
    rng, r, errors = np.random.default_rng(seed), np.zeros(3), np.full((len(w), 3), np.nan)
    command = w[0]
    for t, step in enumerate(w):
        ideal = r + step + rng.normal(0.0, (0.001, 0.0015, 1e-12))
        errors[t] = ideal - command
        r = ideal - command
        seen = None if t in blind else r + rng.normal(0.0, (0.006, 0.001, 1e-12))
        found.observe(command, seen, command)
        command = found.predict().command
    return errors


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=1))))


@pytest.mark.parametrize("path", [circle, pulse])
def test_on_periodic_paths_formation_leaves_a_third_of_what_persistence_leaves(path: object) -> None:
    assert callable(path)
    w = path(50, 13.0)
    closing = ClosingParameters(step_u_m=float(w[0, 0]), step_v_m=float(w[0, 1]))
    found, plain = (predictor(name, closing=closing) for name in ("formation", "previous+close"))
    ours, theirs = (np.abs(follow(either, w)[8:, 1]) for either in (found, plain))
    assert np.sqrt(np.mean(ours**2)) < np.sqrt(np.mean(theirs**2)) / 2.5


def test_without_its_eyes_formation_follows_a_circle_on() -> None:
    w, blind = circle(44, 13.0), tuple(range(30, 33))
    ours = follow(predictor("formation"), w, blind=blind)
    theirs = follow(predictor("previous+close"), w, blind=blind)
    assert np.hypot(*ours[32, :2]) < 0.02 < np.hypot(*theirs[32, :2]) / 2.0


def test_a_leader_that_turns_is_forecast_in_the_frame_of_the_follower() -> None:
    """A leader that drives an arc takes the same step and turn each time, seen from the place that goes with it."""
    w = np.tile([0.005, 0.05, 0.1], (30, 1))
    found = predictor("formation")
    for _ in range(25):
        found.observe(w[0], np.zeros(3), w[0])
    assert found.predict().mean == pytest.approx(w[0], abs=1e-3)
    angles = 0.1 * np.arange(5)
    way = np.stack([0.005 * np.cos(angles) - 0.05 * np.sin(angles), 0.005 * np.sin(angles) + 0.05 * np.cos(angles)], 1)
    assert found.ahead(5)[4].way[:2] == pytest.approx(way.sum(axis=0), abs=8e-3)
    assert found.ahead(5)[4].way[2] == pytest.approx(0.5, abs=8e-3)


@pytest.mark.parametrize("name", ["formation", "previous+close"])
def test_a_turn_that_makes_good_earlier_ones_changes_the_forecast_less_where_that_is_known(name: str) -> None:
    found = []
    for caught_up_rad in (0.0, 0.1):
        made = predictor(name)
        for _ in range(15):
            made.observe(np.array([0.0, 0.05, 0.08]), np.zeros(3))
        made.observe(np.array([0.0, 0.05, 0.2]), np.zeros(3), caught_up_rad=caught_up_rad)
        found.append(abs(made.predict().mean[2] - 0.08))
    assert found[1] < 0.3 * found[0]


@pytest.mark.parametrize("wrong", [-0.1, math.nan, math.inf])
def test_what_a_turn_makes_good_is_a_standard_deviation(wrong: float) -> None:
    made = predictor("formation")
    with pytest.raises(PredictionError, match="caught_up_rad"):
        made.observe(np.array([0.0, 0.05, 0.0]), np.zeros(3), caught_up_rad=wrong)
    assert made.observations == 0


def test_the_aggregation_is_a_choice() -> None:
    parameters = PredictorParameters()
    assert parameters.formation.aggregation == "exponential"
    w = circle(30, 13.0)
    errors = {}
    for kind in ("exponential", "ml_poly"):
        formation = type(parameters.formation)(aggregation=kind)
        errors[kind] = rms(follow(predictor("formation", formation=formation), w)[10:])
    assert errors["exponential"] != errors["ml_poly"]
    assert max(errors.values()) < 0.012


def test_diagnostics_tell_weights_periods_and_the_quality_of_eigenvalues() -> None:
    found = predictor("formation", closing=ClosingParameters(step_v_m=0.05))
    follow(found, circle(40, 13.0))
    shown = found.diagnostics()
    assert shown.weights is not None
    assert shown.notes is not None
    assert set(shown.weights) == {"u", "v", "turn"}
    assert sum(shown.weights["u"].values()) == pytest.approx(1.0)
    assert float(shown.notes["likeliest period along v"]) == pytest.approx(13.0, rel=0.06)
    assert shown.qualities is not None
    assert shown.consistency is not None
    assert 0.0 <= shown.consistency <= 1.0
    json.dumps(found.state(), allow_nan=False)


# --- several steps ahead --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["formation", "previous+close", "trend+close", "measured+close", "literal"])
def test_the_first_of_several_steps_is_the_forecast_and_ways_are_their_sums(name: str) -> None:
    found = predictor(name)
    follow(found, pulse(20, 9.0))
    steps, forecast = found.ahead(14), found.predict()
    assert (steps[0].mean == forecast.mean).all()
    assert (steps[0].covariance == forecast.covariance).all()
    assert steps[13].way == pytest.approx(np.sum([step.mean for step in steps], axis=0))
    spreads = [float(np.trace(step.way_covariance)) for step in steps]
    assert min(spreads) > 0.0
    for step in steps:
        assert np.linalg.eigvalsh(step.way_covariance).min() >= -1e-12
        assert np.linalg.eigvalsh(step.covariance).min() >= -1e-12


def test_the_ellipse_of_several_steps_holds_the_truth_about_as_often_as_it_says() -> None:
    inside: dict[int, list[bool]] = {1: [], 3: [], 5: []}
    for seed in range(3):
        found, r = predictor("formation"), np.zeros(3)
        w = circle(45, 13.0) + np.random.default_rng(seed + 50).normal(0.0, (0.001, 0.0015, 0.0), (45, 3))
        command = w[0]
        ways: list[tuple[int, Array, list[Ahead]]] = []
        rng = np.random.default_rng(seed)
        for t, step in enumerate(w):
            ideal = r + step
            r = ideal - command
            for made, place, ahead in ways:
                h = t - made
                if h in inside and t > 15:
                    error = (w[made + 1 : t + 1].sum(axis=0) + place - ahead[h - 1].way)[:2]
                    inside[h].append(float(error @ np.linalg.solve(ahead[h - 1].way_covariance[:2, :2], error)) < 4.605)
            found.observe(command, r + rng.normal(0.0, (0.006, 0.001, 0.0)), command)
            ways.append((t, r, found.ahead(5)))
            command = found.predict().command
    for h, found_inside in inside.items():
        with case(h):
            assert 0.8 <= np.mean(found_inside) <= 1.0
