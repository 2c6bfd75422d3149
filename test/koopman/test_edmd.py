"""EDMD finds the Koopman operators that are known, agrees with pykoop, and survives poor data."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import case
from koopman_helpers import DT, LAMBDA, MU, SLOPE, slow_manifold
from robot_formation.koopman import (
    EDMD,
    Constant,
    DelayEmbedding,
    Identity,
    Inputs,
    KoopmanError,
    Monomials,
    RadialBasis,
    Regularization,
    Rows,
    spectrum,
)
from robot_formation.koopman.dictionaries import Dictionary

Array = npt.NDArray[np.float64]

PSI = Identity(2) + Monomials([(2, 0)])
SEEDS = st.integers(0, 2**32 - 1)


def states(seed: int, count: int = 40, dimension: int = 2) -> Array:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (dimension, count))


def slow_manifold_model(seed: int = 0, **options: Any) -> EDMD:
    X = states(seed)
    return EDMD.fit(PSI, X, slow_manifold(X), dt=DT, **options)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_the_slow_manifold_has_the_eigenvalues_mu_lambda_and_twice_mu(seed: int) -> None:
    found = slow_manifold_model(seed).continuous_eigenvalues
    assert found.imag == pytest.approx(0.0, abs=1e-8)
    assert found.real == pytest.approx([MU, 2 * MU, LAMBDA], abs=1e-8)  # by falling modulus


def test_the_slow_manifold_has_its_three_eigenfunctions() -> None:
    model = slow_manifold_model()
    x1, x2 = X = states(1)
    for found, true in zip(model.eigenfunctions(X), (x1, x1**2, x2 - SLOPE * x1**2), strict=True):
        assert found * true[0] == pytest.approx(true * found[0], abs=1e-10)
    # Scaled so that the largest coefficient is one.
    assert np.abs(model.spectrum.left).max(axis=1) == pytest.approx(1.0)


def test_eigenfunctions_grow_by_their_eigenvalue_in_each_step() -> None:
    model = slow_manifold_model()
    X = states(2)
    later = model.eigenfunctions(slow_manifold(X))
    assert later == pytest.approx(model.eigenvalues[:, None] * model.eigenfunctions(X), abs=1e-10)


@pytest.mark.parametrize("relift", [False, True])
def test_predictions_of_an_invariant_dictionary_are_exact_over_many_steps(relift: bool) -> None:
    model = slow_manifold_model()
    start = np.array([[0.8], [-0.5]])
    predicted = model.predict(start, 60, relift=relift)
    assert predicted.shape == (2, 60)
    for step in (1, 2, 10, 60):
        assert predicted[:, step - 1] == pytest.approx(slow_manifold(start, step * DT)[:, 0], abs=1e-9)
    assert model.predict(start, 0).shape == (2, 0)


def test_modes_and_eigenfunctions_compose_the_prediction() -> None:
    model = slow_manifold_model()
    start = np.array([[0.8], [-0.5]])
    phi = model.eigenfunctions(start)[:, 0]
    predicted = model.predict(start, 12)
    for step in range(12):
        composed = model.modes @ (model.eigenvalues ** (step + 1) * phi)
        assert composed.imag == pytest.approx(0.0, abs=1e-12)
        assert composed.real == pytest.approx(predicted[:, step], abs=1e-10)


def test_an_oscillation_has_conjugate_eigenvalues_of_its_frequency_and_damping() -> None:
    damping, omega, dt = -0.1, 2.0, 0.2
    c, s = np.cos(omega * dt), np.sin(omega * dt)
    truth = np.exp(damping * dt) * np.array([[c, -s], [s, c]])
    X = states(3)
    model = EDMD.fit(Identity(2), X, truth @ X, dt=dt)
    assert model.k == pytest.approx(truth, abs=1e-12)
    assert model.continuous_eigenvalues == pytest.approx([damping + 1j * omega, damping - 1j * omega], abs=1e-10)
    assert model.modes @ model.eigenfunctions(X) == pytest.approx(X.astype(complex), abs=1e-12)


def test_the_identity_dictionary_gives_dmd_and_a_constant_learns_an_offset() -> None:
    X = states(4)
    offset = np.array([[0.3], [-0.2]])
    truth = np.array([[0.9, 0.1], [0.0, 0.7]])
    affine = EDMD.fit(Identity(2) + Constant(2), X, truth @ X + offset)
    assert affine.k[:2] == pytest.approx(np.hstack([truth, offset]), abs=1e-12)
    assert affine.training_errors.state == pytest.approx(0.0, abs=1e-12)
    assert affine.eigenvalues[0] == pytest.approx(1.0)
    linear = EDMD.fit(Identity(2), X, truth @ X + offset)
    assert linear.k == pytest.approx((truth @ X + offset) @ np.linalg.pinv(X))
    assert linear.training_errors.state > 0.1


@settings(deadline=None, max_examples=40)
@given(n=st.integers(1, 5), ridge=st.sampled_from([0.0, 1e-3, 1.0, 50.0]), seed=SEEDS)
def test_k_minimises_the_ridge_problem_and_equals_an_augmented_lstsq(n: int, ridge: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    X, Y = rng.normal(size=(2, n, 30))
    weights = rng.uniform(0.1, 3.0, 30)
    model = EDMD.fit(Identity(n), X, Y, weights=weights, regularization=Regularization(ridge=ridge))
    rows = np.vstack([(X * np.sqrt(weights)).T, np.sqrt(ridge) * np.eye(n)])
    targets = np.vstack([(Y * np.sqrt(weights)).T, np.zeros((n, n))])
    assert model.k == pytest.approx(np.linalg.lstsq(rows, targets, rcond=None)[0].T, abs=1e-10)
    assert model.condition_number == pytest.approx(np.linalg.cond(X * np.sqrt(weights)))


def test_truncation_uses_the_strongest_directions_only() -> None:
    rng = np.random.default_rng(5)
    X = np.linalg.qr(rng.normal(size=(4, 4)))[0] @ np.diag([1.0, 0.5, 1e-3, 1e-4]) @ rng.normal(size=(4, 30))
    Y = rng.normal(size=(4, 30))
    for rank in (1, 2, 4):
        u, s, vt = np.linalg.svd(X, full_matrices=False)
        expected = Y @ vt[:rank].T @ np.diag(1 / s[:rank]) @ u[:, :rank].T
        model = EDMD.fit(Identity(4), X, Y, regularization=Regularization(rank=rank))
        assert model.k == pytest.approx(expected)
        assert model.rank == rank
    by_tolerance = EDMD.fit(Identity(4), X, Y, regularization=Regularization(tolerance=0.05))
    assert by_tolerance.k == pytest.approx(EDMD.fit(Identity(4), X, Y, regularization=Regularization(rank=2)).k)
    assert by_tolerance.condition_number == pytest.approx(np.linalg.cond(X))


@pytest.mark.parametrize("alpha", [0.0, 0.5])
@pytest.mark.parametrize("degree", [1, 3])
def test_pykoop_agrees_with_lifted_and_regularized_fits(alpha: float, degree: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pykoop = pytest.importorskip("pykoop")
        X = states(6)
        Y = slow_manifold(X) + 0.1 * X[::-1] ** 3
        psi = Monomials.to_degree(2, degree)
        model = EDMD.fit(psi, X, Y, regularization=Regularization(ridge=alpha))
        lifting = pykoop.PolynomialLiftingFn(order=degree)
        lifting.fit(np.zeros((2, 2)), n_inputs=0, episode_feature=False)
        theirs = pykoop.Edmd(alpha=alpha)
        theirs.fit(lifting.transform(X.T), lifting.transform(Y.T), n_inputs=0, episode_feature=False)
        lifted = lifting.transform(X.T).T
    # The observables of both in a common order: that of their first values.
    order, our_order = np.argsort(lifted[:, 0]), np.argsort(psi(X)[:, 0])
    assert lifted[order] == pytest.approx(psi(X)[our_order])
    k = theirs.coef_.T[np.ix_(order, order)]
    assert k == pytest.approx(model.k[np.ix_(our_order, our_order)], abs=1e-9)


def test_pykoop_agrees_with_a_fit_with_inputs() -> None:
    rng = np.random.default_rng(7)
    X, U = rng.normal(size=(2, 60)), rng.normal(size=(1, 60))
    Y = rng.normal(size=(2, 60))
    model = EDMD.fit(Identity(2), X, Y, inputs=U)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pykoop = pytest.importorskip("pykoop")
        theirs = pykoop.Edmd().fit(np.vstack([X, U]).T, Y.T, n_inputs=1, episode_feature=False)
    k_and_b = theirs.coef_.T
    assert k_and_b == pytest.approx(np.hstack([model.k, model.b]), abs=1e-9)


def test_linear_inputs_are_identified_and_predicted_with() -> None:
    rng = np.random.default_rng(8)
    a, b = np.array([[0.9, 0.2], [-0.1, 0.8]]), np.array([[0.5], [1.0]])
    X, U = rng.normal(size=(2, 40)), rng.normal(size=(1, 40))
    model = EDMD.fit(Identity(2), X, a @ X + b @ U, inputs=U)
    assert model.k == pytest.approx(a, abs=1e-12)
    assert model.b == pytest.approx(b, abs=1e-12)
    assert model.errors(X, a @ X + b @ U, inputs=U).lifted == pytest.approx(0.0, abs=1e-12)
    x, u = np.array([[1.0], [-1.0]]), rng.normal(size=(1, 5))
    for relift in (False, True):
        predicted, state = model.predict(x, 5, inputs=u, relift=relift), x
        for step in range(5):
            state = a @ state + b @ u[:, step : step + 1]
            assert predicted[:, step] == pytest.approx(state[:, 0], abs=1e-10)


def test_inputs_may_enter_by_any_dictionary_of_state_and_input() -> None:
    rng = np.random.default_rng(9)
    X, U = rng.normal(size=(2, 60)), rng.normal(size=(1, 60))

    def step(x: Array, u: Array) -> Array:
        return np.array([0.9 * x[0] + 0.3 * x[0] * u[0], 0.7 * x[1] + u[0] ** 2])

    theta = Rows(Identity(2), [0, 1], 3) * Inputs(2, 1) + Rows(Monomials([[2]], ["u1"]), [2], 3)
    model = EDMD.fit(Identity(2), X, step(X, U), inputs=U, input_dictionary=theta)
    assert theta.names == ("x1 u1", "x2 u1", "u1^2")
    assert model.b == pytest.approx(np.array([[0.3, 0.0, 0.0], [0.0, 0.0, 1.0]]), abs=1e-12)
    u, state = rng.normal(size=(1, 6)), np.array([[0.5], [0.5]])
    predicted = model.predict(state, 6, inputs=u)
    for i in range(6):
        state = step(state, u[:, i : i + 1])
        assert predicted[:, i] == pytest.approx(state[:, 0], abs=1e-10)


@pytest.mark.parametrize("relift", [False, True])
def test_delays_find_the_hidden_part_of_a_state(relift: bool) -> None:
    # Of a rotation only one coordinate is seen: alone it says nothing of its future, with one delay it says all.
    angle = 0.3
    seen = np.cos(angle * np.arange(60))[None]
    assert EDMD.fit_trajectories(Identity(1), [seen]).training_errors.state > 0.1
    model = EDMD.fit_trajectories(DelayEmbedding(1, 1), [seen[:, :30], seen[:, 30:]])
    assert model.training_errors.state == pytest.approx(0.0, abs=1e-12)
    assert np.abs(np.angle(model.eigenvalues)) == pytest.approx(angle, abs=1e-9)
    assert model.predict(seen[:, 8:10], 30, relift=relift)[0] == pytest.approx(seen[0, 10:40], abs=1e-9)
    assert model.eigenfunctions(seen[:, :2]).shape == (2, 1)


def test_a_trajectory_and_its_pairs_give_the_same_fit_and_trajectories_are_not_joined() -> None:
    rng = np.random.default_rng(10)
    path, other, u, w = rng.normal(size=(2, 20)), rng.normal(size=(2, 9)), rng.normal(size=19), rng.normal(size=8)
    psi = DelayEmbedding(2, 2)
    one = EDMD.fit_trajectories(psi, [path], inputs=[u[None]])
    pairs = EDMD.fit(psi, path[:, :-1], path[:, 1:], inputs=u[None])
    assert (one.k == pairs.k).all()
    assert (one.b == pairs.b).all()
    both = EDMD.fit_trajectories(psi, [path, other], inputs=[u[None], w[None]])
    rows = [
        (np.vstack([p[:, t], p[:, t - 1], p[:, t - 2]]).ravel(), v[t], np.vstack([p[:, t + 1], p[:, t], p[:, t - 1]]))
        for p, v in ((path, u), (other, w))
        for t in range(2, p.shape[1] - 1)
    ]
    data = np.array([np.append(x, v) for x, v, _ in rows])
    targets = np.array([y.ravel() for _, _, y in rows])
    expected = np.linalg.lstsq(data, targets, rcond=None)[0].T
    assert np.hstack([both.k, both.b]) == pytest.approx(expected, abs=1e-9)


def test_a_state_that_is_no_observable_is_reconstructed_by_least_squares() -> None:
    X = states(11, 200)
    psi = RadialBasis.from_data(X, 25, np.random.default_rng(0), width=1.0)
    model = EDMD.fit(psi, X, slow_manifold(X))
    held_out = states(12, 50)
    assert model.reconstruct(psi(held_out)) == pytest.approx(held_out, abs=0.05)
    assert model.errors(held_out, slow_manifold(held_out)).state < 0.02
    assert model.c == pytest.approx(X @ np.linalg.pinv(psi(X)), rel=1e-6, abs=1e-6 * np.abs(model.c).max())
    exact = EDMD.fit(psi + Identity(2), X, slow_manifold(X))
    assert (exact.reconstruct((psi + Identity(2))(held_out)) == held_out).all()


def test_relifting_keeps_to_the_lifted_states_where_the_dictionary_is_not_invariant() -> None:
    # The logistic map: x^2 of the next state is no combination of x and x^2.
    x = states(13, 100, 1) * 0.45 + 0.5
    logistic = 3.2 * x * (1 - x)
    model = EDMD.fit(Monomials.to_degree(1, 2), x, logistic)
    truth, state = [], 0.3
    for _ in range(8):
        state = 3.2 * state * (1 - state)
        truth.append(state)
    assert model.predict([[0.3]], 8, relift=True)[0] == pytest.approx(truth, abs=1e-9)
    once = model.predict([[0.3]], 8)[0]
    assert once[0] == pytest.approx(truth[0], abs=1e-9)
    assert np.abs(once - truth).max() > 0.05


def test_errors_are_root_mean_squares_of_the_columns_norms() -> None:
    rng = np.random.default_rng(14)
    X, Y, P, Q = rng.normal(size=(4, 2, 20))
    model = EDMD.fit(Identity(2), X, Y)
    for errors, x, y in ((model.training_errors, X, Y), (model.errors(P, Q), P, Q)):
        expected = np.sqrt(np.mean(np.linalg.norm(y - model.k @ x, axis=0) ** 2))
        assert (errors.lifted, errors.state) == pytest.approx((expected, expected))
    assert model.errors(P, Q).state > model.training_errors.state


ONES = np.ones((2, 30))
POOR = {
    "constant": 0.05 * ONES,
    "zero": 0.0 * ONES,
    "collinear": np.outer([0.01, 0.05], 1.0 + 0.1 * np.sin(np.arange(30))),
    "one pair": states(15, 2),
    "huge": 1e150 * states(15, 30),
    "tiny": 1e-250 * states(15, 30),
    "one huge": np.hstack([np.array([[1e140], [0.0]]), states(15, 29)]),
}


@pytest.mark.parametrize("history", POOR.values(), ids=POOR.keys())
@pytest.mark.filterwarnings("error")
def test_poor_data_give_a_finite_model_or_a_sentence(history: Array) -> None:
    dictionaries: dict[str, Dictionary] = {
        "state": Identity(2),
        "lifted": PSI + Constant(2),
        "late": DelayEmbedding(2, 1),
    }
    for name, psi in dictionaries.items():
        for how in (Regularization(), Regularization(ridge=1e-6), Regularization(rank=1)):
            with case(name, how):
                check_poor_data(psi, how, history)


def check_poor_data(psi: Dictionary, how: Regularization, history: Array) -> None:
    if history.shape[1] < psi.history + 2:
        with pytest.raises(KoopmanError, match="too short"):
            EDMD.fit_trajectories(psi, [history])
        return
    model = EDMD.fit_trajectories(psi, [history], regularization=how)
    start = history[:, : psi.history + 1]
    for fitted in (model.k, model.c, model.eigenvalues, model.modes):
        assert np.isfinite(fitted).all()
    assert model.spectrum.condition_number >= 1.0  # infinite where rounding leaves a K defective
    for found in (model.eigenfunctions(start), model.predict(start, 1), model.training_errors.state):
        assert np.isfinite(found).all()
    if how == Regularization() and np.ptp(history) == 0.0:
        assert model.predict(start, 5) == pytest.approx(history[:, :5])


def test_constant_and_collinear_data_have_an_infinite_condition_number() -> None:
    for history in (POOR["zero"], POOR["one pair"]):
        assert EDMD.fit_trajectories(Identity(2), [history]).condition_number == float("inf")
    for history in (POOR["constant"], POOR["collinear"]):
        model = EDMD.fit_trajectories(Identity(2), [history])
        assert model.condition_number > 1e15
        assert model.rank == 1


def test_a_prediction_that_overflows_is_refused_at_its_step() -> None:
    model = EDMD.fit(Identity(1), [[1.0, 2.0]], [[10.0, 20.0]])
    assert np.isfinite(model.predict([[1.0]], 300)).all()
    with pytest.raises(KoopmanError, match="step 309 overflows"):
        model.predict([[1.0]], 400)


def test_the_spectrum_composes_k_and_tells_when_k_is_defective() -> None:
    k = np.random.default_rng(16).normal(size=(5, 5))
    found = spectrum(k)
    assert found.right @ np.diag(found.eigenvalues) @ found.left == pytest.approx(k.astype(complex), abs=1e-10)
    assert found.left @ found.right == pytest.approx(np.eye(5).astype(complex), abs=1e-10)
    assert (np.diff(np.abs(found.eigenvalues)) <= 1e-12).all()
    pairs = [(a, b) for a, b in zip(found.eigenvalues, found.eigenvalues[1:], strict=False) if a == np.conj(b)]
    assert all(first.imag > 0 for first, _ in pairs if first.imag)
    assert found.condition_number < 1e3
    assert spectrum(np.array([[1.0, 1.0], [0.0, 1.0]])).condition_number > 1e8


def test_an_eigenvalue_of_zero_decays_at_once_and_a_negative_one_flips() -> None:
    found = spectrum(np.diag([-1.0, 0.0])).continuous(0.5)
    assert found[0] == pytest.approx(2j * np.pi)
    assert found[1].real == -np.inf


GOOD = states(17)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: EDMD.fit(PSI, GOOD, GOOD[:, 1:]), "Y must have 40 columns"),
        (lambda: EDMD.fit(PSI, GOOD[:1], GOOD[:1]), "X must be a matrix with 2 rows"),
        (lambda: EDMD.fit(PSI, GOOD * np.nan, GOOD), "X must be finite"),
        (lambda: EDMD.fit(PSI, GOOD, GOOD * np.inf), "Y must be finite"),
        (lambda: EDMD.fit(PSI, GOOD[:, :0], GOOD[:, :0]), "too few"),
        (lambda: EDMD.fit(PSI, GOOD, GOOD, dt=0.0), "time between samples"),
        (lambda: EDMD.fit(PSI, GOOD, GOOD, weights=np.ones(3)), "weights must be a vector of length 40"),
        (lambda: EDMD.fit(PSI, GOOD, GOOD, weights=np.zeros(40)), "weights of pairs must be positive"),
        (lambda: EDMD.fit(PSI, GOOD, GOOD, inputs=np.ones((1, 3))), "inputs must have 40 columns"),
        (lambda: EDMD.fit(PSI, GOOD, GOOD, input_dictionary=Inputs(2, 1)), "but no inputs"),
        (
            lambda: EDMD.fit(PSI, GOOD, GOOD, inputs=np.ones((2, 40)), input_dictionary=Inputs(2, 1)),
            "of length 4, not 3",
        ),
        (lambda: EDMD.fit(DelayEmbedding(2, 1), GOOD, GOOD), "the same one step later"),
        (lambda: EDMD.fit_trajectories(PSI, []), "at least one trajectory"),
        (lambda: EDMD.fit_trajectories(PSI, [GOOD], inputs=[]), "as many inputs"),
        (lambda: EDMD.fit_trajectories(PSI, [GOOD, GOOD[:, :1]]), "trajectory 2 is too short"),
        (
            lambda: EDMD.fit_trajectories(PSI, [GOOD, GOOD], inputs=[np.ones((1, 39)), np.ones((2, 39))]),
            "same number of inputs",
        ),
        (lambda: EDMD.fit(Monomials([(3, 0)]), GOOD * 1e150, GOOD), "overflows"),
        (lambda: EDMD.fit(Identity(1), [[1e-300]], [[1e300]]), "least-squares fit overflows"),
        (lambda: Regularization(ridge=-1.0), "ridge"),
        (lambda: Regularization(ridge=np.nan), "ridge"),
        (lambda: Regularization(rank=0), "rank"),
        (lambda: Regularization(tolerance=1.0), "tolerance"),
        (lambda: slow_manifold_model().predict([0.0, 0.0], 1), "start must be a matrix with 2 rows"),
        (lambda: slow_manifold_model().predict(GOOD, 1), "start must have 1 column,"),
        (lambda: slow_manifold_model().predict(GOOD[:, :1], -1), "must not be negative"),
        (lambda: slow_manifold_model().predict(GOOD[:, :1], 1, inputs=[[1.0]]), "has no inputs"),
        (lambda: slow_manifold_model().errors(GOOD, GOOD, inputs=[[1.0]]), "has no inputs"),
        (lambda: slow_manifold_model(inputs=np.ones((1, 40))).errors(GOOD, GOOD), "needs? them too"),
        (lambda: slow_manifold_model(inputs=np.ones((1, 40))).predict(GOOD[:, :1], 1), "needs them too"),
        (lambda: slow_manifold_model().reconstruct(GOOD), "observables must be a matrix with 3 rows"),
        (lambda: spectrum(np.ones((2, 3))), "square"),
        (lambda: spectrum(np.eye(2)).continuous(-1.0), "time between samples"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_data_and_settings_that_make_no_sense_are_refused_with_a_sentence(
    make: Callable[[], object], message: str
) -> None:
    with pytest.raises(KoopmanError, match=message):
        make()
