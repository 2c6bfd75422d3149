"""KoopmanRegressor passes scikit-learn's own checks of estimators, and its tools take it.

Not applicable: `check_array_api_input`, of arrays other than NumPy's, which the estimator doesn't claim to take;
scikit-learn skips it itself. Checks of classifiers, transformers and sample weights are not yielded: it is none and
takes none. `check_dataframe_column_names_consistency`, which scikit-learn keeps for its own estimators, wants messages
of two lines, and ours have one: test_regressor_messages.py tests names of columns.
"""

import pickle
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sklearn.base import clone, is_regressor
from sklearn.exceptions import NotFittedError
from sklearn.metrics import r2_score
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import estimator_checks
from sklearn.utils.validation import check_is_fitted

from koopman_helpers import slow_manifold
from robot_formation.koopman import Identity, KoopmanError, KoopmanRegressor, Monomials, shift_episodes

ESTIMATORS = {
    "dmd": KoopmanRegressor(),
    "edmd": KoopmanRegressor(partial(Monomials.to_degree, degree=2), ridge=1e-3),
}


def yielded(estimator: KoopmanRegressor) -> Iterator[tuple[Any, Callable[[Any], None]]]:
    """All checks of an estimator, of scikit-learn from 1.4 on."""
    if hasattr(estimator_checks, "estimator_checks_generator"):  # 1.6
        yield from estimator_checks.estimator_checks_generator(estimator)
    else:
        yield from estimator_checks.check_estimator(estimator, generate_only=True)


def all_checks() -> Iterator[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it doesn't inherit from scikit-learn's base class
        for kind, estimator in ESTIMATORS.items():
            for i, (one, check) in enumerate(yielded(estimator)):
                name = getattr(getattr(check, "func", check), "__name__", "check")
                yield pytest.param(one, check, id=f"{kind}-{i}-{name}")


CHECKS = list(all_checks())


def test_there_are_as_many_checks_as_scikit_learn_has_for_regressors() -> None:
    assert len(CHECKS) >= 2 * 40


@pytest.mark.parametrize(("estimator", "check"), CHECKS)
def test_it_passes_scikit_learns_check(estimator: KoopmanRegressor, check: Callable[[Any], None]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check(estimator)


def episodes() -> list[Any]:
    """Trajectories of the slow manifold from several starts, one row per state."""
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 2, 1))
    return [np.hstack([slow_manifold(start, 0.1 * t) for t in range(12)]).T for start in starts]


def test_episodes_are_cross_validated_as_groups() -> None:
    X, y, groups = shift_episodes(episodes())
    found = cross_val_score(KoopmanRegressor(Monomials.to_degree(2, 2)), X, y, groups=groups, cv=GroupKFold(3))
    assert found == pytest.approx(np.ones(3))


def test_a_grid_search_finds_the_dictionary_that_the_system_has() -> None:
    X, y, groups = shift_episodes(episodes())
    grid = {"dictionary": [Identity(2), Monomials.to_degree(2, 2)], "ridge": [0.0, 1.0]}
    search = GridSearchCV(KoopmanRegressor(), grid, cv=GroupKFold(3)).fit(X, y, groups=groups)
    assert repr(search.best_estimator_) == "KoopmanRegressor(dictionary=Monomials.to_degree(2, 2))"
    assert search.predict(X) == pytest.approx(y)


def test_a_pipeline_fits_a_scaled_trajectory() -> None:
    path = episodes()[0]
    pipeline = make_pipeline(StandardScaler(), KoopmanRegressor()).fit(path)
    scaled = StandardScaler().fit_transform(path)
    assert pipeline.predict(path) == pytest.approx(KoopmanRegressor().fit(scaled).predict(scaled))


def test_a_clone_is_unfitted_and_what_needs_a_fit_raises_both_libraries_errors() -> None:
    model = KoopmanRegressor(Monomials.to_degree(2, 2), ridge=0.1).fit(episodes())
    check_is_fitted(model)
    fresh = clone(model)
    assert repr(fresh) == repr(model)
    assert is_regressor(fresh)
    with pytest.raises(NotFittedError):
        check_is_fitted(fresh)
    with pytest.raises(NotFittedError) as raised:
        fresh.predict(episodes()[0])
    assert isinstance(raised.value, KoopmanError)
    again = pickle.loads(pickle.dumps(raised.value))
    assert type(again) is type(raised.value)
    assert str(again) == str(raised.value)


def test_the_score_is_scikit_learns() -> None:
    rng = np.random.default_rng(1)
    X, y = rng.normal(size=(2, 50, 3))
    y[:, 1] = 2.0
    model = KoopmanRegressor().fit(X, y)
    assert model.score(X, y) == pytest.approx(r2_score(y, model.predict(X)))
