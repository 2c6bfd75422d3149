"""Dictionaries print as the code that makes them; models and predictors say what they are."""

import numpy as np
import pytest

import robot_formation.koopman as koopman
from robot_formation.koopman import (
    EDMD,
    Concatenation,
    Constant,
    DelayEmbedding,
    Identity,
    Inputs,
    Monomials,
    Observables,
    OnlineDMD,
    RadialBasis,
    Rows,
    WindowedDMD,
    spectrum,
)
from robot_formation.koopman.predictors import NAMES, Predictor, PredictorParameters

WRITTEN = [
    "Identity(2)",
    "Identity(2, ['u', 'v'])",
    "Constant(3)",
    "Monomials([[2, 0], [1, 1]])",
    "Monomials([[2, 0]], ['u', 'v'])",
    "Monomials.to_degree(2, 5)",
    "Monomials.to_degree(2, 2, lowest=0, variables=['u', 'v'])",
    "Rows(Identity(1), [2], 3)",
    "Inputs(2, 1)",
    "Inputs(2, 1, ['torque'])",
    "DelayEmbedding(2, 3)",
    "DelayEmbedding(1, 1, variables=['seen'])",
    "DelayEmbedding(1, 1, Monomials.to_degree(2, 2))",
    "Identity(2) + Constant(2) + Monomials([[2, 0]])",
    "(Identity(2) + Constant(2)) * Monomials.to_degree(2, 3)",
    "Identity(2) + Identity(2) * Monomials([[1, 0]])",
    "Concatenation(Identity(2))",
]


@pytest.mark.parametrize("text", WRITTEN)
def test_a_dictionary_prints_as_it_is_written(text: str) -> None:
    made = eval(text, vars(koopman))
    assert repr(made) == text
    assert made.names == eval(repr(made), vars(koopman)).names


def test_long_or_unknown_dictionaries_print_their_size() -> None:
    table = [[i, 1] for i in range(20)]
    assert repr(Monomials(table)) == "Monomials(<20 rows of exponents>)"
    assert (
        repr(RadialBasis(np.ones((2, 4)), width=0.5)) == "RadialBasis(<4 centres of length 2>, 'gaussian', width=0.5)"
    )

    class Sines(Observables):
        def _lift(self, X: koopman.linear_algebra.Matrix) -> koopman.linear_algebra.Matrix:
            return np.asarray(np.sin(X))

    assert repr(Sines(2, ["sin x1", "sin x2"])) == "<Sines of 2 variables: 2 observables>"


def test_models_print_what_they_were_made_with() -> None:
    X = np.random.default_rng(0).normal(size=(2, 30))
    assert repr(EDMD.fit(Identity(2), X, 0.5 * X, dt=0.1)).startswith(
        "<EDMD of Identity(2): 2 observables, rank 2, condition number 1."
    )
    assert "inputs=Inputs(2, 1)" in repr(EDMD.fit(Identity(2), X, X, inputs=X[:1]))
    assert repr(spectrum(np.diag([0.5, 0.25]))) == "<Spectrum of 2 eigenvalues [0.5 +0.j 0.25+0.j], condition number 1>"
    assert repr(OnlineDMD(2)) == "OnlineDMD(2)"
    assert repr(OnlineDMD(2, outputs=3, forgetting=0.9)) == "OnlineDMD(2, outputs=3, forgetting=0.9)"
    assert repr(WindowedDMD(2, 20, prior_weight=0.5)) == "WindowedDMD(2, 20, prior_weight=0.5)"
    assert repr(OnlineDMD(2, prior_weight=[0.5, 1.0])) == "OnlineDMD(2, prior_weight=<2 numbers>)"


@pytest.mark.parametrize("name", NAMES)
def test_a_predictor_prints_its_name_what_it_has_seen_and_its_model(name: str) -> None:
    predictor = Predictor(PredictorParameters(name=name))
    predictor.observe(np.array([0.0, 0.05, 0.0]))
    text = repr(predictor)
    assert text.startswith(f"<Predictor '{name}' after 1 observations: ")
    assert " object at 0x" not in text


def test_parts_that_are_all_printed_are_public() -> None:
    for kind in (Concatenation, Constant, DelayEmbedding, Identity, Inputs, Monomials, RadialBasis, Rows):
        assert kind.__name__ in koopman.__all__
