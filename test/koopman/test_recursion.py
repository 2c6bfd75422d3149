"""Online and windowed DMD with forgetting and prior equal batch least squares and odmd; their state can be stored."""

import itertools
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from koopman_helpers import DT, LAMBDA, MU, batch, slow_manifold, well_conditioned
from robot_formation.koopman import (
    Identity,
    KoopmanError,
    Monomials,
    OnlineDMD,
    WindowedDMD,
    spectrum,
)

SEEDS = st.integers(0, 2**32 - 1)
KINDS: dict[str, Callable[..., OnlineDMD | WindowedDMD]] = {
    "online": lambda dimension, **options: OnlineDMD(dimension, **options),
    "windowed": lambda dimension, **options: WindowedDMD(dimension, 8, **options),
}


def priors(rng: np.random.Generator, dimension: int, outputs: int) -> tuple[Any, Any]:
    """No prior, one weight, or one for each component."""
    weight: Any = [0.0, 0.5, rng.uniform(0.1, 10.0, dimension)][rng.integers(3)]
    return weight, rng.normal(size=(outputs, dimension)) if np.any(weight) else None


@settings(deadline=None, max_examples=60)
@given(dimension=st.integers(1, 6), forgetting=st.sampled_from([1.0, 0.98, 0.8]), seed=SEEDS)
def test_online_dmd_equals_batch_least_squares_after_every_update(dimension: int, forgetting: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    outputs = int(rng.integers(1, 7))
    weight, k0 = priors(rng, dimension, outputs)
    dmd = OnlineDMD(dimension, outputs=outputs, forgetting=forgetting, prior_weight=weight, prior_k=k0)
    pairs = well_conditioned(rng, dimension, outputs, 40)
    for number, (x, y) in enumerate(pairs, start=1):
        dmd.update(x, y)
        assert dmd.k == pytest.approx(batch(pairs[:number], forgetting, weight, k0), abs=1e-9)


@settings(deadline=None, max_examples=60)
@given(dimension=st.integers(1, 6), forgetting=st.sampled_from([1.0, 0.98, 0.8]), seed=SEEDS)
def test_windowed_dmd_equals_batch_least_squares_of_the_window_after_every_update(
    dimension: int, forgetting: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    outputs, window = int(rng.integers(1, 7)), int(rng.integers(1, 3 * dimension + 2))
    weight, k0 = priors(rng, dimension, outputs)
    dmd = WindowedDMD(dimension, window, outputs=outputs, forgetting=forgetting, prior_weight=weight, prior_k=k0)
    pairs = well_conditioned(rng, dimension, outputs, 40)
    for number, (x, y) in enumerate(pairs, start=1):
        dmd.update(x, y)
        assert dmd.k == pytest.approx(batch(pairs[:number], forgetting, weight, k0, window), abs=1e-9)


@settings(deadline=None, max_examples=40)
@given(kind=st.sampled_from(list(KINDS)), dimension=st.integers(2, 6), seed=SEEDS)
def test_badly_conditioned_data_cost_no_digits_beyond_those_of_the_data(kind: str, dimension: int, seed: int) -> None:
    # Components that differ a thousandfold, as raw displacements, constants and their squares do.
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=(dimension, dimension))
    scale = np.logspace(0, -4, dimension)
    dmd = KINDS[kind](dimension)
    for number, (x, _) in enumerate(well_conditioned(rng, dimension, 1, 60), start=1):
        dmd.update(scale * x, truth @ (scale * x))
        if number >= dimension:
            assert dmd.k == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("forgetting", [1.0, 0.9])
def test_ten_thousand_updates_leave_no_trace_of_rounding(kind: str, forgetting: float) -> None:
    rng = np.random.default_rng(2)
    dmd = KINDS[kind](3, forgetting=forgetting)
    pairs = [(x, rng.normal(size=3)) for x in rng.normal(size=(10_000, 3))]
    for x, y in pairs:
        dmd.update(x, y)
    expected = batch(pairs, forgetting, window=8 if kind == "windowed" else None)
    assert dmd.k == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_p_and_the_condition_number_are_those_of_the_weighted_data_and_prior(kind: str) -> None:
    rng = np.random.default_rng(4)
    for spread in (1.0, 1e-3):  # the second one is fitted without P
        xs = rng.normal(size=(8, 3)) * [1.0, 1.0, spread]
        dmd = KINDS[kind](3, forgetting=0.9, prior_weight=1e-9)
        for x in xs:
            dmd.update(x, x)
        weights = 0.9 ** np.arange(7, -1, -1)
        gram = (xs.T * weights) @ xs + np.eye(3) * 1e-9 * 0.9**8
        assert dmd.started
        assert dmd.p == pytest.approx(np.linalg.inv(gram), rel=1e-6)
        assert dmd.condition_number == pytest.approx(np.sqrt(np.linalg.cond(gram)), rel=1e-6)


def test_with_a_prior_k_starts_there_and_moves_as_far_as_the_pair_weighs() -> None:
    k0 = np.array([[0.5, 0.1], [0.0, 0.9]])
    for weight in (1e-6, 1.0, 1e6):
        dmd = OnlineDMD(2, prior_weight=weight, prior_k=k0)
        assert dmd.started
        assert (dmd.k == k0).all()
        x, y = np.array([1.0, 0.0]), np.array([1.0, 1.0])
        innovation = dmd.update(x, y)
        assert innovation == pytest.approx(y - k0 @ x)
        assert dmd.k == pytest.approx(k0 + np.outer(innovation, x) / (1.0 + weight), abs=1e-9)


def test_the_default_prior_is_persistence() -> None:
    assert (OnlineDMD(3, prior_weight=1.0).k == np.eye(3)).all()


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
def test_odmd_agrees_with_online_dmd(forgetting: float) -> None:
    odmd = pytest.importorskip("odmd")
    rng = np.random.default_rng(6)
    xs, ys = rng.normal(size=(2, 4, 60))
    theirs = odmd.OnlineDMD(4, forgetting)
    theirs.initialize(xs[:, :10], ys[:, :10])
    ours = OnlineDMD(4, forgetting=forgetting)
    for number, (x, y) in enumerate(zip(xs.T, ys.T, strict=True)):
        ours.update(x, y)
        if number >= 10:
            theirs.update(x, y)
            assert ours.k == pytest.approx(theirs.A, abs=1e-9)


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
def test_odmd_agrees_with_windowed_dmd(forgetting: float) -> None:
    odmd = pytest.importorskip("odmd")
    rng = np.random.default_rng(7)
    xs, ys = rng.normal(size=(2, 4, 60))
    theirs = odmd.WindowDMD(4, 12, forgetting)
    theirs.initialize(xs[:, :12], ys[:, :12])
    ours = WindowedDMD(4, 12, forgetting=forgetting)
    for number, (x, y) in enumerate(zip(xs.T, ys.T, strict=True)):
        ours.update(x, y)
        if number >= 12:
            theirs.update(x, y)
            assert ours.k == pytest.approx(theirs.A, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_lifted_pairs_give_the_koopman_operator_of_a_nonlinear_system(kind: str) -> None:
    psi = Identity(2) + Monomials([(2, 0)])
    X = np.random.default_rng(8).uniform(-1, 1, (2, 30))
    dmd = KINDS[kind](psi.size)
    for x, y in zip(psi(X).T, psi(slow_manifold(X)).T, strict=True):
        dmd.update(x, y)
    found = spectrum(dmd.k).continuous(DT)
    assert np.sort(found.real) == pytest.approx(sorted([LAMBDA, 2 * MU, MU]), abs=1e-8)
    assert found.imag == pytest.approx(0.0, abs=1e-8)


def test_a_window_forgets_what_it_does_not_hold() -> None:
    rng = np.random.default_rng(9)
    dmd = WindowedDMD(2, 10)
    for truth in (np.eye(2), -np.eye(2)):
        for x in rng.normal(size=(10, 2)):
            dmd.update(x, truth @ x)
        assert dmd.k == pytest.approx(truth, abs=1e-9)


HISTORIES = {
    "constant": [np.array([0.013, 0.05])] * 40,
    "collinear": [np.array([0.013, 0.05]) * (1.0 + 0.1 * np.sin(n)) for n in range(40)],
    "zero": [np.zeros(2)] * 40,
    "huge": [np.array([1e99, -3e98]) * (-1.0) ** n for n in range(40)],
    "huge then usual": [np.array([1e99, 2e98]), *np.random.default_rng(0).normal(size=(39, 2))],
    "usual then huge": [*np.random.default_rng(0).normal(size=(20, 2)), *[np.array([1e90, 2e99])] * 20],
    "tiny": [np.array([1e-200, 3e-201]) * n for n in range(40)],
    "one direction, then the other": [np.array([1.0, 0.0])] * 20 + [np.array([0.0, 1.0])] * 20,
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("options", [{}, {"forgetting": 0.5}, {"prior_weight": 1e-4}], ids=str)
@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.filterwarnings("error")
def test_any_finite_history_gives_a_finite_k_of_no_great_size(
    kind: str, options: dict[str, float], history: str
) -> None:
    dmd = KINDS[kind](2, **options)
    for x in HISTORIES[history]:
        innovation = dmd.update(x, 0.9 * x)
        assert np.isfinite(innovation).all()
        assert np.abs(dmd.k).max() < 1.1
        assert dmd.p is None or np.isfinite(dmd.p).all()
    if (kind, history) != ("online", "huge then usual"):  # nothing counts beside the first pair there
        assert dmd.k @ x == pytest.approx(0.9 * x, abs=0.2 * np.abs(x).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        ([np.nan, 1.0], [1.0, 1.0], "two finite vectors of length 2"),
        ([1.0, 1.0], [1.0, -np.inf], "two finite vectors of length 2"),
        ([1e300, 1e300], [1.0, 1.0], "add up to at most 1e\\+100"),
        ([1.0], [1.0, 1.0], "two finite vectors of length 2"),
        ([[1.0, 1.0]], [1.0, 1.0], "two finite vectors of length 2"),
        (["left", 1.0], [1.0, 1.0], "real numbers"),
        ([1e-100, 1e-100], [1e99, 1e99], "K would overflow"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_a_pair_that_makes_no_sense_is_refused_and_nothing_is_learned(
    kind: str, x: list[Any], y: list[float], message: str
) -> None:
    dmd, twin = KINDS[kind](2), KINDS[kind](2)
    with pytest.raises(KoopmanError, match=message):
        dmd.update(x, y)
    for either in (dmd, twin):
        for vector in np.random.default_rng(1).normal(size=(12, 2)):
            either.update(vector, vector[::-1])
    assert dmd.state() == twin.state()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"outputs": 0}, "outputs 0"),
        ({"forgetting": np.nan}, "forgetting factor"),
        ({"prior_weight": -1.0}, "prior weights"),
        ({"prior_weight": [1.0, 0.0]}, "prior weights"),
        ({"prior_weight": [1.0, 1.0, 1.0]}, "length 2"),
        ({"prior_weight": np.nan}, "finite"),
        ({"prior_k": np.eye(2)}, "needs a prior weight"),
        ({"prior_weight": 1.0, "prior_k": np.eye(3)}, "prior K"),
        ({"max_condition": 1.0}, "condition number"),
        ({"max_condition": 1e9}, "condition number"),
    ],
)
@pytest.mark.parametrize("kind", KINDS)
def test_settings_that_make_no_sense_are_refused(kind: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(KoopmanError, match=message):
        KINDS[kind](2, **options)


def test_an_empty_window_is_refused() -> None:
    with pytest.raises(KoopmanError, match="at least one pair"):
        WindowedDMD(2, 0)


@settings(deadline=None, max_examples=60)
@given(kind=st.sampled_from(list(KINDS)), before=st.integers(0, 20), spread=st.sampled_from([1.0, 1e-4]), seed=SEEDS)
def test_a_restored_state_goes_on_to_the_last_bit(kind: str, before: int, spread: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    prior = {"prior_weight": 0.3, "prior_k": rng.normal(size=(2, 3))} if rng.random() < 0.5 else {}
    dmd = KINDS[kind](3, outputs=2, forgetting=0.9, **prior)
    xs, ys = rng.normal(size=(before + 20, 3)) * [1.0, 1.0, spread], rng.normal(size=(before + 20, 2))
    for x, y in zip(xs[:before], ys[:before], strict=True):
        dmd.update(x, y)
    twin = type(dmd).from_state(json.loads(json.dumps(dmd.state())))
    assert twin.state() == dmd.state()
    assert (twin.started, twin.condition_number) == (dmd.started, dmd.condition_number)
    for x, y in zip(xs[before:], ys[before:], strict=True):
        assert (dmd.update(x, y) == twin.update(x, y)).all()
    assert twin.state() == dmd.state()


DAMAGE = [
    *(
        (kind, {"settings": settings}, "stored state")
        for kind in KINDS
        for settings in ({"dimension": 2, "s": 3}, None)
    ),
    ("online", {"k": [[1.0]]}, "'k' of the stored state"),
    ("online", {"k": [[1.0, "x"], [0.0, 1.0]]}, "real numbers"),
    ("online", {"p": [[1.0, 0.0], [0.0, -1.0]]}, "positive definite"),
    ("online", {"p": [[1.0, 0.5], [0.0, 1.0]]}, "symmetric"),
    ("online", {"p": [[1.0, np.nan], [np.nan, 1.0]]}, "finite"),
    ("online", {"trace": "far"}, "stored state"),
    ("online", {"trace": None}, "stored state"),
    ("windowed", {"x": [[1.0]]}, "'x' of the stored state"),
    ("windowed", {"y": [[1.0, "x"]]}, "real numbers"),
    ("windowed", {"y": [[1.0, np.nan]]}, "finite"),
    ("windowed", {"x": [[1e200, 1.0]], "y": [[1.0, 1.0]]}, "at most 1e"),
    ("windowed", {"prior_share": "far"}, "stored state"),
    ("windowed", {"prior_share": None}, "stored state"),
]


@pytest.mark.parametrize(("kind", "change", "message"), DAMAGE)
def test_a_stored_state_that_was_damaged_is_refused(kind: str, change: dict[str, Any], message: str) -> None:
    dmd = KINDS[kind](2)
    for x in np.random.default_rng(3).normal(size=(12, 2)):
        dmd.update(x, x)
    with pytest.raises(KoopmanError, match=message):
        type(dmd).from_state({**dmd.state(), **change})
    for name in dmd.state():
        with pytest.raises(KoopmanError, match=f"the stored state has no '{name}'"):
            type(dmd).from_state({key: value for key, value in dmd.state().items() if key != name})


def test_stored_states_whose_parts_do_not_fit_are_refused() -> None:
    online, windowed = OnlineDMD(2), WindowedDMD(2, 3)
    for dmd in (online, windowed):
        dmd.update([1.0, 2.0], [1.0, 2.0])
    change: dict[str, Any]
    for change in ({"z": []}, {"kept": [3, 3]}, {"trace": -1.0}):
        with pytest.raises(KoopmanError, match="fit each other"):
            OnlineDMD.from_state({**online.state(), **change})
    for change in ({"y": []}, {"x": [[1.0, 2.0]] * 4, "y": [[1.0, 2.0]] * 4}, {"prior_share": 2.0}):
        with pytest.raises(KoopmanError, match="fit each other"):
            WindowedDMD.from_state({**windowed.state(), **change})


def test_a_lower_bound_of_conditions_leaves_directions_out_that_only_noise_shows() -> None:
    rng = np.random.default_rng(11)
    direction = np.array([0.01, 0.05])
    xs = direction + rng.normal(0.0, 1e-4, (3, 2))
    careful, trusting = OnlineDMD(2, max_condition=50.0), OnlineDMD(2)
    for dmd in (careful, trusting):
        for x, y in itertools.pairwise(xs):
            dmd.update(x, y)
    assert trusting.started
    assert not careful.started
    assert np.abs(careful.k).max() < 1.1
