"""KoopmanRegressor finds what is known of linear and nonlinear systems, and does what `EDMD` does, in rows."""

import pickle
import subprocess
import sys
import warnings
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from koopman_helpers import DT, LAMBDA, MU, slow_manifold
from robot_formation.koopman import (
    EDMD,
    Constant,
    DelayEmbedding,
    Identity,
    KoopmanError,
    KoopmanRegressor,
    Monomials,
    NotFittedError,
    RadialBasis,
    Regularization,
    shift_episodes,
)

Array = npt.NDArray[np.float64]

TURN = 0.3
LINEAR = np.array(
    [[0.97 * np.cos(TURN), -0.97 * np.sin(TURN), 0.2], [0.97 * np.sin(TURN), 0.97 * np.cos(TURN), 0.0], [0.0, 0.0, 0.6]]
)


def random_rows(seed: int, count: int = 60, length: int = 3) -> Array:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, length))


def path_of(matrix: Array, start: Array, count: int) -> Array:
    """A trajectory of a linear system, one row per state."""
    states = [start]
    for _ in range(count - 1):
        states.append(matrix @ states[-1])
    return np.array(states)


def linear_model(**options: Any) -> KoopmanRegressor:
    X = random_rows(0)
    return KoopmanRegressor(**options).fit(X, X @ LINEAR.T)


# --- known operators ------------------------------------------------------------------------------------------------


def test_a_linear_system_has_its_matrix_its_eigenvalues_and_its_eigenvectors_as_modes() -> None:
    model = linear_model(dt=0.5)
    assert model.coef_ == pytest.approx(LINEAR, abs=1e-12)
    pair = 0.97 * np.exp(1j * TURN)
    assert model.eigenvalues_ == pytest.approx([pair, np.conj(pair), 0.6], abs=1e-12)
    assert model.continuous_eigenvalues_ == pytest.approx(np.log([pair, np.conj(pair), 0.6]) / 0.5, abs=1e-12)
    values, vectors = np.linalg.eig(LINEAR)
    for value, mode in zip(model.eigenvalues_, model.modes_.T, strict=True):
        known = vectors[:, np.argmin(abs(values - value))]
        assert abs(np.vdot(known, mode)) == pytest.approx(np.linalg.norm(known) * np.linalg.norm(mode))


def test_modes_and_eigenfunctions_compose_what_is_simulated() -> None:
    model = linear_model()
    x0 = np.array([0.5, -1.0, 0.8])
    phi = model.eigenfunctions(x0[None])
    assert phi.shape == (1, 3)
    composed = [model.modes_ @ (model.eigenvalues_**t * phi[0]) for t in range(1, 13)]
    assert model.simulate(x0, 12) == pytest.approx(np.real(composed), abs=1e-12)


@pytest.mark.parametrize("relift", [False, True])
def test_simulated_states_of_a_linear_system_are_powers_of_its_matrix(relift: bool) -> None:
    x0 = np.array([1.0, 0.2, -0.7])
    found = linear_model().simulate(x0, 30, relift=relift)
    assert found == pytest.approx(np.array([np.linalg.matrix_power(LINEAR, t) @ x0 for t in range(1, 31)]), abs=1e-11)
    assert linear_model().simulate(x0, 0).shape == (0, 3)


def test_the_slow_manifold_is_found_with_the_square_of_its_first_variable() -> None:
    X = random_rows(1, length=2)
    model = KoopmanRegressor(Identity(2) + Monomials([(2, 0)]), dt=DT).fit(X, slow_manifold(X.T).T)
    assert model.continuous_eigenvalues_.real == pytest.approx([MU, 2 * MU, LAMBDA], abs=1e-8)
    held_out = random_rows(2, length=2)
    assert model.predict(held_out) == pytest.approx(slow_manifold(held_out.T).T, abs=1e-12)
    assert model.score(held_out, slow_manifold(held_out.T).T) == pytest.approx(1.0)
    assert model.simulate(held_out[0], 50)[-1] == pytest.approx(slow_manifold(held_out[:1].T, 50 * DT)[:, 0], abs=1e-9)


def test_the_logistic_map_is_exact_in_one_step_and_relifted_but_not_linear() -> None:
    x = random_rows(3, 100, 1) * 0.45 + 0.5
    model = KoopmanRegressor(Monomials.to_degree(1, 2)).fit(x, 3.2 * x * (1.0 - x))
    assert model.coef_ == pytest.approx(np.array([[3.2, -3.2]]), abs=1e-9)
    truth, state = [], 0.3
    for _ in range(8):
        state = 3.2 * state * (1.0 - state)
        truth.append(state)
    assert model.simulate([0.3], 8, relift=True)[:, 0] == pytest.approx(truth, abs=1e-9)
    linear = model.simulate([0.3], 8)[:, 0]
    assert linear[0] == pytest.approx(truth[0], abs=1e-9)
    assert np.abs(linear - truth).max() > 0.05


def pendulum(amplitude: float, count: int = 80, dt: float = 0.1) -> Array:
    """Angle and its rate of a pendulum of period 2 pi for small angles, by the classical Runge-Kutta method."""

    def rate(state: Array) -> Array:
        return np.array([state[1], -np.sin(state[0])])

    states = [np.array([amplitude, 0.0])]
    for _ in range(count - 1):
        x = states[-1]
        a = rate(x)
        b = rate(x + dt / 2 * a)
        c = rate(x + dt / 2 * b)
        states.append(x + dt / 6 * (a + 2 * b + 2 * c + rate(x + dt * c)))
    return np.array(states)


def test_cubic_monomials_describe_a_pendulum_better_than_dmd_and_with_its_frequency() -> None:
    episodes = [pendulum(amplitude) for amplitude in (0.2, 0.5, 0.8, 1.1)]
    held_out = [pendulum(0.65)]
    dmd = KoopmanRegressor(dt=0.1).fit(episodes)
    cubic = KoopmanRegressor(partial(Monomials.to_degree, degree=3), dt=0.1).fit(episodes)
    assert 1.0 - cubic.score(held_out) < 0.01 * (1.0 - dmd.score(held_out)) < 1e-4
    frequencies = np.abs(cubic.continuous_eigenvalues_.imag)
    assert np.abs(frequencies - 1.0).min() < 0.05  # slower than 1 the farther it swings
    left = np.abs(cubic.simulate(held_out[0][0], 40) - held_out[0][1:41]).max()
    assert left < 0.2 * np.abs(dmd.simulate(held_out[0][0], 40) - held_out[0][1:41]).max()


# --- rows, episodes and what EDMD does -----------------------------------------------------------------------------


@pytest.mark.parametrize("psi", [None, Identity(3) + Constant(3), Monomials.to_degree(3, 2), DelayEmbedding(3, 2)])
def test_it_is_edmd_with_rows_for_columns_to_the_last_bit(psi: Any) -> None:
    path = random_rows(4)
    how = Regularization(ridge=1e-3, rank=5)
    model = KoopmanRegressor(psi, ridge=1e-3, rank=5, dt=0.2).fit(path)
    columns = EDMD.fit_trajectories(psi or Identity(3), [path.T], regularization=how, dt=0.2)
    for found in (model, KoopmanRegressor(psi, ridge=1e-3, rank=5, dt=0.2).fit(path[:-1], path[1:])):
        assert (found.model_.k == columns.k).all()
        assert (found.eigenvalues_ == columns.eigenvalues).all()
        assert (found.modes_ == columns.modes).all()
    history = model.dictionary_.history
    start = path[: history + 1]
    for relift in (False, True):
        assert (model.simulate(start, 9, relift=relift) == columns.predict(start.T, 9, relift=relift).T).all()
    assert model.predict(path).shape == (60 - history, 3)
    assert model.predict(start)[0] == pytest.approx(model.simulate(start, 1)[0], abs=1e-12)
    assert (model.eigenfunctions(path) == columns.eigenfunctions(path.T).T).all()


def test_pairs_never_cross_episodes() -> None:
    episodes = [
        path_of(LINEAR, start, count) for start, count in zip(5.0 * random_rows(5, 4), (4, 9, 2, 6), strict=True)
    ]
    apart = KoopmanRegressor().fit(episodes)
    assert apart.coef_ == pytest.approx(LINEAR, abs=1e-10)
    assert apart.score(episodes) == pytest.approx(1.0)
    joined = KoopmanRegressor().fit(np.vstack(episodes))
    assert np.abs(joined.coef_ - LINEAR).max() > 0.01
    X, y, groups = shift_episodes(episodes)
    assert groups.tolist() == [0] * 3 + [1] * 8 + [2] + [3] * 5
    assert y == pytest.approx(X @ LINEAR.T)
    assert (KoopmanRegressor().fit(X, y).coef_ == apart.coef_).all()


def test_one_trajectory_equals_its_parts_that_share_a_state_and_episodes_of_one_length_may_be_an_array() -> None:
    path = random_rows(6, 21)
    whole = KoopmanRegressor().fit(path)
    parts = path[:11], path[10:]
    assert (KoopmanRegressor().fit(list(parts)).coef_ == whole.coef_).all()
    assert (KoopmanRegressor().fit(parts).coef_ == whole.coef_).all()
    assert (KoopmanRegressor().fit(np.array(parts)).coef_ == whole.coef_).all()
    assert (KoopmanRegressor().fit([part.tolist() for part in parts]).coef_ == whole.coef_).all()
    assert (KoopmanRegressor().fit(path.tolist()).coef_ == whole.coef_).all()


def test_delays_are_filled_anew_in_each_episode() -> None:
    episodes = [np.cos(TURN * np.arange(25) + phase)[:, None] for phase in (0.0, 1.0, 2.5)]
    model = KoopmanRegressor(DelayEmbedding(1, 1)).fit(episodes)
    assert np.abs(np.angle(model.eigenvalues_)) == pytest.approx(TURN, abs=1e-9)
    assert model.score(episodes) == pytest.approx(1.0)
    for relift in (False, True):
        found = model.simulate(episodes[1][3:5], 20, relift=relift)
        assert found == pytest.approx(episodes[1][5:25], abs=1e-9)
    joined = KoopmanRegressor(DelayEmbedding(1, 1)).fit(np.vstack(episodes))
    assert np.abs(np.abs(np.angle(joined.eigenvalues_)) - TURN).max() > 1e-3


def test_other_quantities_one_step_later_are_predicted_without_a_k() -> None:
    X = random_rows(7, length=2)
    energy = (slow_manifold(X.T) ** 2).sum(axis=0)
    psi = Monomials.to_degree(2, 4, lowest=0)
    model = KoopmanRegressor(psi).fit(X, energy)
    assert model.predict(X) == pytest.approx(energy, abs=1e-10)  # a polynomial of degree 4
    assert model.predict(X).shape == (60,)
    assert KoopmanRegressor(psi).fit(X, energy[:, None]).predict(X).shape == (60, 1)
    assert model.coef_[0] == pytest.approx(np.linalg.lstsq(psi(X.T).T, energy, rcond=None)[0], abs=1e-9)
    assert model.score(X, energy) == pytest.approx(1.0)
    for ask in (lambda: model.eigenvalues_, lambda: model.simulate(X[0], 3), lambda: model.score(X)):
        with pytest.raises(NotFittedError, match="there is no K: y of the fit held 1 other values, not the 2"):
            ask()
    assert not hasattr(model, "modes_")
    late = KoopmanRegressor(DelayEmbedding(2, 1)).fit(X, np.roll(X[:, 0], 1))
    assert late.predict(X) == pytest.approx(X[:-1, 0], abs=1e-12)


def test_the_score_is_the_mean_r_squared_and_a_steady_value_counts_when_it_is_met() -> None:
    X = random_rows(8)
    y = X @ LINEAR.T + 0.3 * random_rows(9)
    model = KoopmanRegressor().fit(X, y)
    left = ((y - model.predict(X)) ** 2).sum(axis=0)
    r2 = 1.0 - left / ((y - y.mean(axis=0)) ** 2).sum(axis=0)
    assert model.score(X, y) == pytest.approx(r2.mean())
    still = X * [1.0, 0.0, 1.0]
    assert KoopmanRegressor().fit(still, still).score(still, still) == pytest.approx(1.0)
    y[:, 1] = 2.0
    r2[1] = 0.0
    assert KoopmanRegressor().fit(X, y).score(X, y) == pytest.approx(r2.mean())
    assert np.isnan(model.score(X[:1], y[:1]))


# --- other libraries ------------------------------------------------------------------------------------------------


def test_pykoop_agrees_on_episodes_lifted_by_monomials() -> None:
    episodes = [
        slow_manifold_path(start, count) for start, count in zip(random_rows(10, 3, 2), (20, 12, 30), strict=True)
    ]
    model = KoopmanRegressor(Monomials.to_degree(2, 2), ridge=0.05).fit(episodes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pykoop = pytest.importorskip("pykoop")
        theirs = pykoop.KoopmanPipeline(
            lifting_functions=[("polynomials", pykoop.PolynomialLiftingFn(order=2))], regressor=pykoop.Edmd(alpha=0.05)
        )
        joined = np.vstack([np.column_stack([np.full(len(e), i), e]) for i, e in enumerate(episodes)])
        theirs.fit(joined, n_inputs=0, episode_feature=True)
        predicted = theirs.predict(joined[: len(episodes[0])])[:, 1:]
    known = np.sort_complex(np.linalg.eigvals(theirs.regressor_.coef_.T))
    assert np.sort_complex(model.eigenvalues_) == pytest.approx(known, abs=1e-9)
    assert model.predict(episodes[0]) == pytest.approx(predicted, abs=1e-9)


def slow_manifold_path(start: Array, count: int) -> Array:
    return np.array([slow_manifold(start[:, None], t * DT)[:, 0] for t in range(count)])


def test_odmd_agrees_after_all_pairs() -> None:
    odmd = pytest.importorskip("odmd")
    X = random_rows(11)
    y = X @ LINEAR.T + 0.1 * random_rows(12)
    online = odmd.OnlineDMD(3, 1.0)
    online.initialize(X[:6].T, y[:6].T)
    for before, after in zip(X[6:], y[6:], strict=True):
        online.update(before, after)
    assert KoopmanRegressor().fit(X, y).coef_ == pytest.approx(online.A, abs=1e-9)


def test_neither_importing_nor_using_it_needs_scikit_learn() -> None:
    code = """
import sys
sys.modules["sklearn"] = None  # importing it fails
import robot_formation.koopman as koopman
model = koopman.KoopmanRegressor()
try:
    model.predict([[1.0]])
except koopman.NotFittedError as error:
    assert type(error) is koopman.NotFittedError
    print(error)
print(model.fit([[1.0], [2.0], [4.0]]).simulate([1.0], 3).ravel().tolist(), model)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    first, second = done.stdout.splitlines()
    assert first == "this KoopmanRegressor is not fitted yet: call fit first"
    assert second.endswith("] KoopmanRegressor()")
    assert np.fromstring(second[1 : second.index("]")], sep=",") == pytest.approx([2.0, 4.0, 8.0])


# --- parameters -----------------------------------------------------------------------------------------------------


def test_parameters_are_read_and_set_by_name_and_shown_where_they_are_not_the_usual_ones() -> None:
    model = KoopmanRegressor(Identity(2), ridge=0.5)
    assert model.get_params() == {
        "dictionary": model.dictionary,
        "ridge": 0.5,
        "rank": None,
        "tolerance": None,
        "dt": 1.0,
    }
    assert model.set_params(rank=2, ridge=0.0) is model
    assert repr(model) == "KoopmanRegressor(dictionary=Identity(2), rank=2)"
    with pytest.raises(KoopmanError, match="no parameter 'rigde'"):
        model.set_params(rank=1, rigde=0.1)
    assert model.rank == 2


def test_a_fitted_model_survives_pickling() -> None:
    X = random_rows(13, length=2)
    psi = RadialBasis.from_data(X.T, 5, np.random.default_rng(0)) + Identity(2)
    model = KoopmanRegressor(psi).fit(X, slow_manifold(X.T).T)
    again = pickle.loads(pickle.dumps(model))
    assert (again.predict(X) == model.predict(X)).all()
    assert (again.eigenvalues_ == model.eigenvalues_).all()


def test_a_class_is_a_function_that_makes_a_dictionary() -> None:
    X = random_rows(15)
    assert repr(KoopmanRegressor(Identity).fit(X).dictionary_) == "Identity(3)"


def test_errors_survive_pickling() -> None:
    with pytest.raises(NotFittedError) as raised:
        KoopmanRegressor().predict([[1.0]])
    again = pickle.loads(pickle.dumps(raised.value))
    assert type(again) is type(raised.value)
    assert str(again) == str(raised.value)


def test_changing_what_the_attributes_return_does_not_change_the_model() -> None:
    model = linear_model()
    for name in ("coef_", "eigenvalues_", "continuous_eigenvalues_", "modes_"):
        before = getattr(model, name)
        getattr(model, name)[:] = 0.0
        assert (getattr(model, name) == before).all()
    assert (model.predict(random_rows(16)) == linear_model().predict(random_rows(16))).all()


def test_a_failed_fit_leaves_the_last_one() -> None:
    model = linear_model()
    X = random_rows(14)
    before = model.predict(X)
    with pytest.raises(KoopmanError):
        model.fit(X[:, :2], np.full((60, 2), np.nan))
    assert (model.predict(X) == before).all()
