"""EDMD as an estimator of scikit-learn: `fit`, `predict`, `score`, `get_params`. scikit-learn itself is not needed.

Snapshots are ROWS here, as in scikit-learn, pykoop and pykoopman: X has the shape (m, n), m states of length n. In all
other parts of this library they are columns, as in the paper. scikit-learn's tools (cross-validation, grid search,
pipelines, `clone`) know an estimator by its methods, so no base class of theirs is needed.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.koopman.dictionaries import Dictionary, Identity
from robot_formation.koopman.edmd import EDMD
from robot_formation.koopman.linear_algebra import (
    ComplexMatrix,
    KoopmanError,
    Matrix,
    Regularization,
    Vector,
    check_finite,
    check_time_step,
    solve,
)
from robot_formation.koopman.samples import (
    check_feature_names,
    check_features,
    checked_episodes,
    checked_rows,
    checked_targets,
    dimensions,
    feature_names,
    is_episodes,
)


class NotFittedError(KoopmanError, AttributeError):
    """The estimator was asked for what only `fit` brings. Where scikit-learn is loaded, also its NotFittedError."""

    def __reduce__(self) -> tuple[Callable[..., NotFittedError], tuple[Any, ...]]:
        """Pickle as text: whether scikit-learn is loaded is asked anew where it is read."""
        return _not_fitted, self.args


class KoopmanRegressor:
    """Extended dynamic mode decomposition (EDMD) with snapshots in rows; without a dictionary plain DMD.

    It fits Psi(y) = K Psi(x) to pairs of a state x and its successor y, and predicts successors by y = C K Psi(x). The
    pairs are (X, y), or the neighbouring rows of a trajectory, or of several episodes; they never cross episodes.

    Inputs (control) and weights of pairs: see `EDMD`, which has both.

    Arrays among the attributes are copies: changing them does not change the model.

    Attributes:
        model_: the fitted `EDMD` with K, C and the spectrum (columns are snapshots there). It, eigenvalues and modes
            are missing if y held other quantities than the states.
        dictionary_: Psi, of k observables.
        coef_: C K, shape (n, k): predictions are coef_ Psi(x). With other quantities in y it has q rows.
        eigenvalues_: Koopman eigenvalues (k,) per step, by falling modulus.
        continuous_eigenvalues_: log(eigenvalue) / dt, shape (k,) [1/s].
        modes_: Koopman modes, the columns of a matrix (n, k).
        n_features_in_: n.
        feature_names_in_: names of the columns of X, shape (n,), if X was a table (data frame).
    """

    _estimator_type = "regressor"  # scikit-learn before 1.6

    def __init__(
        self,
        dictionary: Dictionary | Callable[[int], Dictionary] | None = None,
        *,
        ridge: float = 0.0,
        rank: int | None = None,
        tolerance: float | None = None,
        dt: float = 1.0,
    ) -> None:
        """Set parameters; they are checked by `fit`.

        Args:
            dictionary: Psi; or a function that makes one for states of a length, as
                `functools.partial(Monomials.to_degree, degree=2)` does; None for the state itself.
            ridge: Tikhonov's lambda >= 0 in |Psi(Y) - K Psi(X)|^2 + lambda |K|^2.
            rank: at most so many singular values of Psi(X) are used; None for all.
            tolerance: singular values below this part of the largest are dropped; None for those lost in rounding.
            dt: time between a state and its successor [s].
        """
        self.dictionary = dictionary
        self.ridge = ridge
        self.rank = rank
        self.tolerance = tolerance
        self.dt = dt

    def __repr__(self) -> str:
        changed = [f"{name}={value!r}" for name, value in self.get_params().items() if not _is_default(name, value)]
        return f"{type(self).__name__}({', '.join(changed)})"

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor's arguments by name; `deep` changes nothing, as none of them is an estimator."""
        return {name: getattr(self, name) for name in _DEFAULTS}

    def set_params(self, **params: Any) -> KoopmanRegressor:
        """Set arguments of the constructor by name; they are checked by `fit`.

        Raises:
            KoopmanError: if there is no such argument.
        """
        for name in params:
            if name not in _DEFAULTS:
                raise KoopmanError(f"no parameter '{name}' of {type(self).__name__}: it has {', '.join(_DEFAULTS)}")
        for name, value in params.items():
            setattr(self, name, value)
        return self

    def fit(self, X: ArrayLike | Sequence[ArrayLike], y: ArrayLike | None = None) -> KoopmanRegressor:
        """Fit to pairs (X, y), a trajectory X, or a list X of trajectories.

        In a pipeline, steps before this one change X and not y: fit trajectories there, without y.

        Args:
            X: states (m, n), one per row. Without y, consecutive ones: a trajectory, or a list of them (episodes, each
                of its own length) whose pairs never cross from one to the next.
            y: (m, n), the successor of each row of X. Or other quantities one step later, (m,) or (m, q) with q other
                than n: then `predict` and `score` work as for any regressor, but there is no K, and no spectrum.

        Raises:
            KoopmanError: if the data don't fit each other, the dictionary or the parameters, or are not finite.
            TypeError: if an element is no number.
        """
        given, parts = _episodes(X, y)
        n, names = parts[0].shape[1], feature_names(given[0])
        how = Regularization(self.ridge, self.rank, self.tolerance)
        check_time_step(self.dt)
        dictionary = self._made_dictionary(n)
        check_features(parts[0], "X", dictionary.dimension, type(self).__name__)
        targets = None if y is None else checked_targets(y, parts[0])
        model, coef = _fitted(dictionary, parts, targets, how, self.dt)
        self._model, self.dictionary_, self._coef, self.n_features_in_ = model, dictionary, coef, n
        self._flat = targets is not None and targets.ndim == 1
        self.__dict__.pop("feature_names_in_", None)
        if names is not None:
            self.feature_names_in_ = names
        return self

    def predict(self, X: ArrayLike) -> Matrix:
        """Predict the successor of each state, one step ahead; `simulate` goes on from there.

        Args:
            X: states (m, n), one per row; consecutive ones if the dictionary has a history h.

        Returns:
            (m - h, n), the successors of rows h, h + 1, ...; with other quantities in y of the fit, (m - h, q), or
            (m - h,) if y was a vector.

        Raises:
            NotFittedError: before `fit`.
            KoopmanError: if X doesn't fit the dictionary, is not finite, or the prediction overflows.
        """
        self._require_fit()
        found = self._predicted(self._checked_states(X, "X"))
        return np.asarray(found[0] if self._flat else found.T)

    def simulate(self, x0: ArrayLike, n_steps: int, *, relift: bool = False) -> Matrix:
        """Return the next states after x0, shape (n_steps, n), one per row; x0 is not among them.

        By default x0 is lifted once and K applied n_steps times, C K^t Psi(x0): the linear system that eigenvalues and
        modes describe. With `relift` each state is lifted anew, x_t+1 = C K Psi(x_t), which often errs less where the
        dictionary's span is not invariant. The first step is the same; see `EDMD.predict`.

        Args:
            x0: the state (n,); if the dictionary has a history h, with those before it, (h + 1, n), the newest last.
            n_steps: how many, zero or more.
            relift: lift anew in each step.

        Raises:
            NotFittedError: before `fit`, or if y of the fit held other quantities than states.
            KoopmanError: if x0 doesn't fit the dictionary, or a state overflows.
        """
        model = self.model_
        start = self._checked_states(np.atleast_2d(x0) if dimensions(x0) in (0, 1) else x0, "x0")
        if len(start) != self.dictionary_.history + 1:
            wanted = self.dictionary_.history + 1
            raise KoopmanError(f"x0 must have {wanted} row{'s' * (wanted != 1)}, the newest last, not {len(start)}")
        return np.asarray(model.predict(start.T, n_steps, relift=relift).T)

    def score(self, X: ArrayLike | Sequence[ArrayLike], y: ArrayLike | None = None) -> float:
        """Return the coefficient of determination R^2 of one-step predictions, the mean over the values of a state.

        1 is perfect, 0 no better than the mean. A value that never changes counts 1 if it is met, else 0.

        Args:
            X: as in `fit`.
            y: as in `fit`.

        Returns:
            R^2; NaN with fewer than two predictions.

        Raises:
            NotFittedError: before `fit`.
            KoopmanError: as `fit` and `predict`.
        """
        self._require_fit()
        given, parts = _episodes(X, y)
        for table, part in zip(given, parts, strict=True):
            self._check_states(table, part, "X")
        if y is None:
            history = self.model_.dictionary.history
            if min(map(len, parts)) < history + 2:
                raise KoopmanError(f"a trajectory is too short: it needs {history + 2} states at least")
            predicted = np.vstack([self._predicted(part[:-1]).T for part in parts])
            return _r_squared(np.vstack([part[history + 1 :] for part in parts]), predicted)
        predicted = self._predicted(parts[0])
        truth = checked_targets(y, parts[0])[self.dictionary_.history :]
        if truth.size != predicted.size:
            raise KoopmanError(f"y must have {len(self._coef)} columns as in the fit, not shape {truth.shape}")
        return _r_squared(truth.reshape(len(truth), -1), predicted.T)

    def eigenfunctions(self, X: ArrayLike) -> ComplexMatrix:
        """Evaluate the Koopman eigenfunctions at states (m, n), one per row.

        Returns:
            Values (m - history, k), one row per state, columns in the order of `eigenvalues_`.

        Raises:
            NotFittedError: before `fit`, or if y of the fit held other quantities than states.
            KoopmanError: if X doesn't fit the dictionary.
        """
        model = self.model_
        return np.asarray((model.spectrum.left @ self._lifted(self._checked_states(X, "X"))).T)

    @property
    def model_(self) -> EDMD:
        """The fitted EDMD.

        Raises:
            NotFittedError: if there is none.
        """
        self._require_fit()
        if self._model is None:
            raise _not_fitted(
                f"there is no K: y of the fit held {len(self._coef)} other values, not the {self.n_features_in_} of a "
                "state's successor"
            )
        return self._model

    @property
    def coef_(self) -> Matrix:
        """C K, shape (n, k), or (q, k) with q other quantities in y of the fit.

        Raises:
            NotFittedError: before `fit`.
        """
        self._require_fit()
        return np.array(self._coef)

    @property
    def eigenvalues_(self) -> NDArray[np.complex128]:
        """Koopman eigenvalues (k,) per step, by falling modulus."""
        return np.array(self.model_.eigenvalues)

    @property
    def continuous_eigenvalues_(self) -> NDArray[np.complex128]:
        """Koopman eigenvalues (k,) in continuous time, log(eigenvalue) / dt [1/s]."""
        return self.model_.continuous_eigenvalues

    @property
    def modes_(self) -> ComplexMatrix:
        """Koopman modes of the state, the columns of a matrix (n, k)."""
        return self.model_.modes

    def _made_dictionary(self, n: int) -> Dictionary:
        made: Any = self.dictionary
        if made is None:
            return Identity(n)
        if isinstance(made, type):  # a class has its instances' `dimension` as a property
            made = _instance(made, n)
        elif not hasattr(made, "dimension") and callable(made):
            made = made(n)
        if isinstance(made, type) or not hasattr(made, "dimension"):
            raise KoopmanError(f"the dictionary must be a Dictionary, a function that makes one, or None, not {made!r}")
        found: Dictionary = made
        return found

    def _predicted(self, rows: Matrix) -> Matrix:
        """Predict from checked states (m, n): (q, m - history)."""
        lifted = self._lifted(rows)
        with np.errstate(over="ignore", invalid="ignore"):
            found: Matrix = self._coef @ lifted
        check_finite(found, "the prediction")
        return found

    def _lifted(self, rows: Matrix) -> Matrix:
        """Lift checked states (m, n): (k, m - history)."""
        history = self.dictionary_.history
        if len(rows) <= history:
            raise KoopmanError(f"X must have {history + 1} consecutive rows at least, not {len(rows)}")
        return self.dictionary_(rows.T)

    def _checked_states(self, X: Any, what: str) -> Matrix:
        rows = checked_rows(X, what)
        self._check_states(X, rows, what)
        return rows

    def _check_states(self, given: object, rows: Matrix, what: str) -> None:
        check_features(rows, what, self.n_features_in_, type(self).__name__)
        if hasattr(self, "feature_names_in_"):
            check_feature_names(given, self.feature_names_in_.tolist())

    def _require_fit(self) -> None:
        """Do nothing after `fit`.

        Raises:
            NotFittedError: before it.
        """
        if not self.__sklearn_is_fitted__():
            raise _not_fitted(f"this {type(self).__name__} is not fitted yet: call fit first")

    def __sklearn_is_fitted__(self) -> bool:
        """Whether `fit` has been called; scikit-learn's `check_is_fitted` asks."""
        return "_coef" in self.__dict__

    def __sklearn_tags__(self) -> Any:
        """Describe the estimator to scikit-learn, which alone calls this (from 1.6 on)."""
        from sklearn.utils import InputTags, RegressorTags, Tags, TargetTags

        return Tags(
            estimator_type="regressor",
            target_tags=TargetTags(required=False, multi_output=True),
            regressor_tags=RegressorTags(),
            input_tags=InputTags(),
        )

    def _more_tags(self) -> Mapping[str, bool]:
        """Describe the estimator to scikit-learn before 1.6."""
        return {"multioutput": True}


_DEFAULTS: dict[str, Any] = {
    name: argument.default
    for name, argument in inspect.signature(KoopmanRegressor.__init__).parameters.items()
    if name != "self"
}


def _is_default(name: str, value: object) -> bool:
    default = _DEFAULTS[name]
    return value is default or (isinstance(value, (int, float)) and value == default)


def _episodes(X: Any, y: object) -> tuple[list[Any], list[Matrix]]:
    """Return trajectories as given, one by itself in a list, and checked."""
    if not is_episodes(X):
        return [X], [checked_rows(X, "X")]
    if y is not None:
        raise KoopmanError("episodes hold their successors themselves: with a list of them y must be None")
    return list(X), checked_episodes(X)


def _instance(kind: type, n: int) -> Any:
    try:
        return kind(n)
    except (KoopmanError, TypeError) as error:
        raise KoopmanError(
            f"the dictionary is the class {kind.__name__}, which can't be made from the length {n} of a state alone: "
            "give an instance, or a function that makes one"
        ) from error


def _fitted(
    dictionary: Dictionary, parts: list[Matrix], y: Matrix | None, how: Regularization, dt: float
) -> tuple[EDMD | None, Matrix]:
    """Return the model, None if y holds other quantities than successors, and the coefficients (q, k)."""
    X = parts[0]
    if y is None:
        model = EDMD.fit_trajectories(dictionary, [part.T for part in parts], regularization=how, dt=dt)
    elif y.size == X.size:
        model = EDMD.fit(dictionary, X.T, y.reshape(X.shape).T, regularization=how, dt=dt)
    else:
        return None, _regressed(dictionary, X, y, how)
    return model, model.c @ model.k


def _regressed(dictionary: Dictionary, X: Matrix, y: Matrix, how: Regularization) -> Matrix:
    """Fit y = coef Psi(x) to other quantities y (m,) or (m, q) than successors; shape (q, k)."""
    if len(X) <= dictionary.history:
        raise KoopmanError(f"X must have {dictionary.history + 1} consecutive rows at least, not {len(X)}")
    return solve(dictionary(X.T), y.reshape(len(y), -1)[dictionary.history :].T, how).k


def _r_squared(truth: Matrix, predicted: Matrix) -> float:
    if len(truth) < 2:
        return float("nan")
    left = ((truth - predicted) ** 2).sum(axis=0)
    whole = ((truth - truth.mean(axis=0)) ** 2).sum(axis=0)
    shares: Vector = np.where(left == 0.0, 0.0, np.divide(left, whole, out=np.ones_like(left), where=whole > 0.0))
    return float(1.0 - shares.mean())


def _not_fitted(*arguments: Any) -> NotFittedError:
    exceptions = sys.modules.get("sklearn.exceptions")
    return (NotFittedError if exceptions is None else _both(exceptions.NotFittedError))(*arguments)


@cache
def _both(theirs: type[Exception]) -> type[NotFittedError]:
    """Make the class that both libraries' users catch."""
    return type("NotFittedError", (NotFittedError, theirs), {})
