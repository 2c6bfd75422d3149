"""Dictionaries say what they compute, compute what they say, and fit together."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robot_formation.koopman import (
    Concatenation,
    Constant,
    DelayEmbedding,
    Identity,
    Inputs,
    KoopmanError,
    Monomials,
    Product,
    RadialBasis,
    Rows,
)
from robot_formation.koopman.dictionaries import Observables

X = np.array([[0.5, -1.0, 2.0, 0.0], [3.0, 0.25, -2.0, 1.0]])
CENTRES = np.array([[0.0, 2.0], [1.0, -2.0]])

EXAMPLES = {
    "identity": Identity(2),
    "constant": Constant(2),
    "monomials": Monomials.to_degree(2, 3),
    "monomials with constant": Monomials.to_degree(2, 2, lowest=0),
    "gaussian": RadialBasis(CENTRES),
    "thin plate": RadialBasis(CENTRES, "thin_plate"),
    "inverse quadratic": RadialBasis(CENTRES, "inverse_quadratic"),
    "rows": Rows(Monomials.to_degree(1, 2), [1], 2),
    "input": Inputs(1, 1),
    "delays": DelayEmbedding(2, 2),
    "lifted delays": DelayEmbedding(2, 1, Monomials.to_degree(4, 2)),
    "sum": Identity(2) + Constant(2) + RadialBasis(CENTRES),
    "sum of delays": DelayEmbedding(2, 1) + Monomials([(2, 0)]),
    "product": (Constant(2) + Identity(2)) * (Constant(2) + RadialBasis(CENTRES)),
    "product of delays": DelayEmbedding(2, 1) * (Identity(2) + Constant(2)),
}


@pytest.mark.parametrize("psi", EXAMPLES.values(), ids=EXAMPLES.keys())
def test_every_dictionary_keeps_the_protocol(psi: Observables) -> None:
    lifted = psi(X)
    assert lifted.shape == (psi.size, X.shape[1] - psi.history)
    assert np.isfinite(lifted).all()
    assert len(psi.names) == psi.size
    assert len(psi.state_rows) == psi.dimension == 2
    for state, row in zip(X[:, psi.history :], psi.state_rows, strict=True):
        assert row is None or (lifted[row] == state).all()
    # Each column depends on its own state and the history before it only, and the states are left alone.
    for column in range(lifted.shape[1]):
        assert psi(X[:, column : column + psi.history + 1])[:, 0] == pytest.approx(lifted[:, column], rel=1e-12)
    assert (X == [[0.5, -1.0, 2.0, 0.0], [3.0, 0.25, -2.0, 1.0]]).all()


@pytest.mark.parametrize("psi", EXAMPLES.values(), ids=EXAMPLES.keys())
@pytest.mark.parametrize(
    ("states", "message"),
    [
        (np.ones((3, 4)), "with 2 rows"),
        (np.ones(2), "one column per snapshot"),
        (np.full((2, 4), np.nan), "finite"),
        ([["a", "b", "c", "d"]] * 2, "real numbers"),
    ],
)
def test_every_dictionary_refuses_states_that_are_none(
    psi: Observables, states: list[list[str]] | npt.NDArray[np.float64], message: str
) -> None:
    with pytest.raises(KoopmanError, match=message):
        psi(states)


def test_an_observable_that_overflows_is_named() -> None:
    with pytest.raises(KoopmanError, match=r"the observable x1\^2 overflows"):
        (Identity(2) + Monomials([(2, 0)]))(np.array([[1e200], [1.0]]))


def test_monomials_come_by_degree_and_then_by_falling_powers_of_the_first_variables() -> None:
    assert Monomials.to_degree(2, 3).names == (
        "x1",
        "x2",
        "x1^2",
        "x1 x2",
        "x2^2",
        "x1^3",
        "x1^2 x2",
        "x1 x2^2",
        "x2^3",
    )
    assert Monomials.to_degree(3, 2, lowest=2).names == ("x1^2", "x1 x2", "x1 x3", "x2^2", "x2 x3", "x3^2")
    assert Monomials.to_degree(2, 1, lowest=0, variables=["u", "v"]).names == ("1", "u", "v")


@settings(deadline=None, max_examples=50)
@given(
    dimension=st.integers(1, 4),
    degree=st.integers(0, 4),
    lowest=st.integers(0, 1),
    data=st.data(),
)
def test_monomials_are_all_products_of_powers_up_to_the_degree(
    dimension: int, degree: int, lowest: int, data: st.DataObject
) -> None:
    degree = max(degree, lowest)
    psi = Monomials.to_degree(dimension, degree, lowest=lowest)
    assert psi.size == len(set(psi.names)) == math.comb(dimension + degree, degree) - lowest
    states = data.draw(arrays(float, (dimension, 3), elements=st.floats(-2.0, 2.0)))
    letters = {f"x{i + 1}": row for i, row in enumerate(states)}
    for name, row in zip(psi.names, psi(states), strict=True):
        expected = eval(name.replace("^", "**").replace(" ", " * "), {}, letters)
        assert row == pytest.approx(np.broadcast_to(expected, 3), rel=1e-12)


def test_monomials_of_chosen_exponents_find_the_state_among_them() -> None:
    psi = Monomials([(0, 1), (2, 1), (1, 0)])
    assert psi.names == ("x2", "x1^2 x2", "x1")
    assert psi.state_rows == (2, 0)


def test_radial_basis_functions_are_their_formulas() -> None:
    r = np.linalg.norm(X[:, None, :] - CENTRES[:, :, None], axis=0) / 0.7
    assert RadialBasis(CENTRES, width=0.7)(X) == pytest.approx(np.exp(-(r**2)))
    assert RadialBasis(CENTRES, "inverse_quadratic", width=0.7)(X) == pytest.approx(1 / (1 + r**2))
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = np.where(r > 0, r**2 * np.log(r), 0.0)
    assert RadialBasis(CENTRES, "thin_plate", width=0.7)(X) == pytest.approx(expected)


def test_a_thin_plate_is_zero_at_its_centre() -> None:
    assert RadialBasis(CENTRES, "thin_plate")(CENTRES).diagonal() == pytest.approx(0.0, abs=0.0)


def test_centres_chosen_from_data_are_different_snapshots_and_the_same_for_the_same_seed() -> None:
    data = np.random.default_rng(1).normal(size=(2, 50)).round(1)
    psi = RadialBasis.from_data(data, 12, np.random.default_rng(5))
    again = RadialBasis.from_data(data, 12, np.random.default_rng(5))
    other = RadialBasis.from_data(data, 12, np.random.default_rng(6))
    chosen = {tuple(centre) for centre in psi.centres.T}
    assert len(chosen) == 12
    assert chosen <= {tuple(snapshot) for snapshot in data.T}
    assert (psi.centres == again.centres).all()
    assert (psi.centres != other.centres).any()
    distances = [math.dist(a, b) for a in chosen for b in chosen if a < b]
    assert psi.width == pytest.approx(np.median(distances))


def test_centres_chosen_from_data_are_spread_out() -> None:
    clusters = np.repeat(np.array([[0.0, 100.0, 0.0], [0.0, 0.0, 100.0]]), [500, 2, 2], axis=1)
    clusters = clusters + np.random.default_rng(0).normal(size=clusters.shape)
    psi = RadialBasis.from_data(clusters, 3, np.random.default_rng(2))
    assert {tuple(corner) for corner in (psi.centres > 50).T} == {(False, False), (True, False), (False, True)}


def test_more_centres_than_different_snapshots_are_refused() -> None:
    with pytest.raises(KoopmanError, match="only 1 snapshots are different"):
        RadialBasis.from_data(np.ones((2, 9)), 2, np.random.default_rng(0))


def test_delays_stack_the_latest_states_newest_first() -> None:
    psi = DelayEmbedding(2, 2, variables=["u", "v"])
    assert psi.names == ("u", "v", "u(t-1)", "v(t-1)", "u(t-2)", "v(t-2)")
    assert (psi(X) == np.vstack([X[:, 2:], X[:, 1:3], X[:, 0:2]])).all()
    assert psi.state_rows == (0, 1)


def test_too_short_a_trajectory_is_refused() -> None:
    with pytest.raises(KoopmanError, match="at least 3 consecutive columns"):
        DelayEmbedding(2, 2)(X[:, :2])


def test_parts_of_different_history_are_aligned_at_the_newest_state() -> None:
    psi = DelayEmbedding(2, 2) + Identity(2)
    lifted = psi(X)
    assert (lifted[:2] == lifted[6:]).all()
    product = DelayEmbedding(2, 1) * Identity(2)
    assert (product(X)[0] == X[0, 1:] ** 2).all()


def test_a_concatenation_finds_each_component_of_the_state_in_any_part() -> None:
    psi = Constant(2) + Rows(Identity(1), [1], 2) + Rows(Identity(1), [0], 2)
    assert psi.state_rows == (2, 1)
    assert Concatenation(Constant(2), Rows(Identity(1), [1], 2)).state_rows == (None, 1)


def test_a_product_holds_all_products_in_the_order_it_says() -> None:
    left, right = Identity(2), Constant(2) + Monomials([(0, 2)])
    product = left * right
    assert product.names == ("x1", "x1 x2^2", "x2", "x2 x2^2")
    assert product.state_rows == (0, 2)
    assert (product(X) == [X[0], X[0] * X[1] ** 2, X[1], X[1] ** 3]).all()
    assert (right * left).state_rows == (0, 1)
    assert Product(left, left).state_rows == (None, None)


def test_inputs_are_the_lower_rows_and_bilinear_terms_can_be_built() -> None:
    stacked = np.vstack([X, [[7.0, 8.0, 9.0, 10.0]]])
    inputs = Inputs(2, 1)
    assert inputs.names == ("u1",)
    assert (inputs(stacked) == stacked[2:]).all()
    bilinear = Rows(Identity(2), [0, 1], 3) * inputs
    assert bilinear.names == ("x1 u1", "x2 u1")
    assert (bilinear(stacked) == X * stacked[2]).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Identity(0), "at least one component"),
        (lambda: Constant(-1), "at least one component"),
        (lambda: Identity(2, ["u"]), "2 names"),
        (lambda: Identity(1, ["1"]), "none of them '1'"),
        (lambda: Monomials([]), "table of integers"),
        (lambda: Monomials([(0.5, 1.0)]), "table of integers"),  # type: ignore[list-item]
        (lambda: Monomials([(1, -1)]), "table of integers"),
        (lambda: Monomials.to_degree(2, 1, lowest=2), "lowest <= degree"),
        (lambda: Monomials.to_degree(0, 1), "dimension of at least 1"),
        (lambda: Monomials.to_degree(40, 8), "too many"),
        (lambda: RadialBasis(np.empty((2, 0))), "at least one centre"),
        (lambda: RadialBasis([[np.nan]]), "finite"),
        (lambda: RadialBasis(CENTRES, "gausian"), "did you mean 'gaussian'"),
        (lambda: RadialBasis(CENTRES, width=0.0), "width"),
        (lambda: RadialBasis.from_data(X, 0, np.random.default_rng(0)), "at least one centre"),
        (lambda: Rows(Identity(2), [0, 2], 2), "between 0 and 1"),
        (lambda: Rows(Identity(2), [0], 2), "2 rows"),
        (lambda: Inputs(2, 0), "at least one component"),
        (lambda: DelayEmbedding(2, -1), "number of delays"),
        (lambda: DelayEmbedding(2, 1, Identity(2)), "length 4"),
        (lambda: DelayEmbedding(2, 1, DelayEmbedding(4, 1)), "itself have none"),
        (lambda: Identity(2) + Identity(3), "same length"),
        (lambda: Concatenation(), "same length"),
        (lambda: Identity(2) * Identity(3), "same length"),
    ],
)
def test_dictionaries_that_make_no_sense_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(KoopmanError, match=message):
        make()
