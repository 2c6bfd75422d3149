"""What `KoopmanRegressor` refuses, it refuses with one line that says what is swapped."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from robot_formation.koopman import (
    DelayEmbedding,
    Identity,
    KoopmanError,
    KoopmanRegressor,
    Monomials,
    NotFittedError,
    shift_episodes,
)

ROWS = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 2))


def fitted(**options: Any) -> KoopmanRegressor:
    return KoopmanRegressor(**options).fit(ROWS, ROWS[::-1])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: KoopmanRegressor(Identity(2)).fit(ROWS.T), r"are rows, got 2 rows of 100 values: transpose\?"),
        (lambda: fitted().predict(ROWS.T), r"X has 100 features, .* expecting 2 .* 2 rows of 100 values: transpose\?"),
        (lambda: fitted().score(ROWS.T), "2 rows of 100 values: transpose"),
        (lambda: fitted().eigenfunctions(ROWS.T), "2 rows of 100 values: transpose"),
        (lambda: fitted().simulate([[1.0], [2.0]], 3), "x0 has 1 features, .* got 2 rows of 1 values: transpose"),
        (lambda: fitted().predict(ROWS[:, :1]), r"of 2 values; the shape is \(100, 1\)"),
        (lambda: fitted().simulate([1.0, 2.0, 3.0], 3), "x0 has 3 features"),
        (lambda: fitted().simulate(ROWS, 3), "x0 must have 1 row, the newest last, not 100"),
        (lambda: fitted().simulate([1.0, 2.0], -1), "must not be negative"),
        (lambda: KoopmanRegressor().fit(ROWS, ROWS.T), r"\(100, 2\) and \(2, 100\): snapshots are rows; transpose y"),
        (lambda: KoopmanRegressor().fit(ROWS.T, ROWS), r"\(2, 100\) and \(100, 2\): snapshots are rows; transpose X"),
        (lambda: KoopmanRegressor().fit(ROWS, ROWS[1:]), r"as many rows, .* \(100, 2\) and \(99, 2\)$"),
        (lambda: KoopmanRegressor().fit(ROWS[:, 0]), "Reshape your data"),
        (lambda: KoopmanRegressor().fit(ROWS[:0]), "0 sample"),
        (lambda: KoopmanRegressor().fit(ROWS, ROWS[:, :, None]), "y must hold one row for each of the 100 rows"),
        (lambda: KoopmanRegressor().fit(ROWS * np.nan), "finite"),
        (lambda: KoopmanRegressor().fit(ROWS * 1j), "Complex data not supported"),
        (lambda: KoopmanRegressor().fit([["a", "b"]] * 3), "real numbers"),
        (lambda: KoopmanRegressor().fit(ROWS[:1]), "too short"),
        (lambda: KoopmanRegressor().fit([ROWS, ROWS[:1]]), "trajectory 2 is too short"),
        (
            lambda: KoopmanRegressor().fit([ROWS, ROWS[:, :1]]),
            "episode 2 has states of length 1, episode 1 of length 2",
        ),
        (lambda: KoopmanRegressor().fit([ROWS, ROWS], ROWS), "y must be None"),
        (lambda: fitted().score([ROWS, ROWS], ROWS), "y must be None"),
        (lambda: fitted().score([ROWS, ROWS[:1]]), "too short"),
        (lambda: fitted().score(ROWS, ROWS[:, 0]), "y must have 2 columns as in the fit"),
        (lambda: KoopmanRegressor(DelayEmbedding(2, 3)).fit(ROWS, ROWS), "the same one step later"),
        (
            lambda: KoopmanRegressor(DelayEmbedding(2, 3)).fit(ROWS[:2], ROWS[:2, 0]),
            "4 consecutive rows at least, not 2",
        ),
        (lambda: KoopmanRegressor(DelayEmbedding(2, 3)).fit(ROWS).predict(ROWS[:3]), "4 consecutive rows at least"),
        (lambda: KoopmanRegressor(DelayEmbedding(2, 3)).fit(ROWS).simulate(ROWS[0], 1), "x0 must have 4 rows"),
        (lambda: KoopmanRegressor("identity").fit(ROWS), "must be a Dictionary"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(Monomials.to_degree(2, 3)).fit(ROWS).predict(ROWS * 1e200), "overflows"),
        (lambda: KoopmanRegressor(ridge=-1.0).fit(ROWS), "ridge"),
        (lambda: KoopmanRegressor(dt=0.0).fit(ROWS), "time between samples"),
        (lambda: KoopmanRegressor(Monomials).fit(ROWS), "the class Monomials, .* give an instance"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(DelayEmbedding).fit(ROWS), "class DelayEmbedding, .* an instance"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(int).fit(ROWS), "must be a Dictionary"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(ridge="a").fit(ROWS), "ridge must be a number, .* not 'a'"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(ridge=None).fit(ROWS), "ridge must be .* not None"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(rank=1.5).fit(ROWS), "rank must be a whole number"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(tolerance="a").fit(ROWS), "tolerance must be a number"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(dt="a").fit(ROWS), "samples must be a number, .* not 'a'"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor(dt=-1.0).fit(ROWS, ROWS[:, 0]), "samples must be a number"),
        (lambda: fitted().simulate(ROWS[0], 1.5), "number of steps must be whole"),  # type: ignore[arg-type]
        (lambda: fitted().simulate(ROWS[0], "a"), "number of steps must be whole"),  # type: ignore[arg-type]
        (lambda: KoopmanRegressor().fit([[1, 2], [3]]), "X must hold real numbers only"),
        (lambda: fitted().simulate([[1, 2], [3]], 1), "x0 must hold real numbers only"),  # type: ignore[list-item]
        (lambda: KoopmanRegressor().fit(None), "X must hold real numbers, but it is None"),  # type: ignore[arg-type]
        (lambda: shift_episodes(ROWS), "put a single one into a list"),  # type: ignore[arg-type]
        (lambda: shift_episodes([ROWS, ROWS[:1]]), "episode 2 is too short"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_makes_no_sense_is_refused_with_a_sentence(make: Callable[[], object], message: str) -> None:
    with pytest.raises(KoopmanError, match=message) as refused:
        make()
    assert "\n" not in str(refused.value)


def test_what_needs_a_fit_says_so() -> None:
    model = KoopmanRegressor()
    for ask in (
        lambda: model.predict(ROWS),
        lambda: model.simulate(ROWS[0], 1),
        lambda: model.score(ROWS),
        lambda: model.eigenfunctions(ROWS),
        lambda: model.eigenvalues_,
    ):
        with pytest.raises(NotFittedError, match="call fit first"):
            ask()
    assert not hasattr(model, "eigenvalues_")


class Table:
    """As much of a data frame as the estimator looks at."""

    ndim = 2

    def __init__(self, values: npt.NDArray[np.float64], *columns: object) -> None:
        self.columns, self._values = columns, values

    def __array__(self, *arguments: Any, **options: Any) -> npt.NDArray[np.float64]:
        return np.array(self._values)


def test_names_of_columns_are_kept_and_have_to_come_in_the_order_of_the_fit() -> None:
    model = KoopmanRegressor().fit(Table(ROWS, "angle", "rate"))  # type: ignore[arg-type]
    assert model.feature_names_in_.tolist() == ["angle", "rate"]
    assert (model.predict(Table(ROWS, "angle", "rate")) == model.predict(ROWS)).all()  # type: ignore[arg-type]
    for ask in (model.predict, model.score, model.eigenfunctions):
        with pytest.raises(KoopmanError, match=r"\['angle', 'rate'\] are needed in the same order but"):
            ask(Table(ROWS, "rate", "angle"))
    with pytest.raises(KoopmanError, match=r"are needed but they are \['angle', 'speed'\]"):
        model.predict(Table(ROWS, "angle", "speed"))  # type: ignore[arg-type]
    assert not hasattr(model.fit(ROWS), "feature_names_in_")
    assert not hasattr(model.fit(Table(ROWS, 0, 1)), "feature_names_in_")  # type: ignore[arg-type]
