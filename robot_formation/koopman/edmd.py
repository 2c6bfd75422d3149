"""Extended dynamic mode decomposition (EDMD): a finite Koopman matrix fitted to pairs of snapshots.

The paper's section "Koopman operator theory and EDMD", in its letters: states x_t and y_t = F(x_t) are the columns of X
and Y, Psi is a dictionary of k observables, and

    K = argmin sum_t |Psi(y_t) - K Psi(x_t)|^2 = Psi(Y) Psi(X)^+         so that  K Psi = Psi o F  as well as it can be.

From K follow the Koopman eigenvalues lambda_j, the eigenfunctions phi_j = w_j Psi (w_j a left eigenvector of K), which
obey phi_j(F(x)) = lambda_j phi_j(x), and the modes v_j of the state, x_t = sum_j lambda_j^t phi_j(x_0) v_j. The method
is that of Williams, Kevrekidis and Rowley, "A data-driven approximation of the Koopman operator", J. Nonlinear Sci.
25(6), 2015; with inputs it is that of Korda and Mezic, "Linear predictors for nonlinear dynamical systems", Automatica
93, 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_formation.koopman.dictionaries import Dictionary
from robot_formation.koopman.linear_algebra import (
    ComplexMatrix,
    KoopmanError,
    Matrix,
    Regularization,
    as_matrix,
    as_vector,
    check_finite,
    check_time_step,
    solve,
)
from robot_formation.koopman.pairs import Pairs
from robot_formation.koopman.spectrum import Spectrum, spectrum


@dataclass(frozen=True)
class Errors:
    """Root mean squares, over pairs, of the one-step errors |Psi(y) - K Psi(x)| and |y - C K Psi(x)| (state's unit)."""

    lifted: float
    state: float


@dataclass(frozen=True, eq=False)
class EDMD:
    """A fitted model Psi(y) = K Psi(x), or with inputs u Psi(y) = K Psi(x) + B Theta([x; u]).

    Columns are snapshots, everywhere in this class: X has the shape (n, m). `KoopmanRegressor` is the same with
    snapshots in rows, as scikit-learn, pykoop and pykoopman have them.

    Attributes:
        dictionary: Psi, of k observables of states of length n.
        input_dictionary: Theta, of p observables of [x; u]; None without inputs.
        k: K, shape (k, k).
        b: B, shape (k, p); p is 0 without inputs.
        c: the state from the observables, x = C Psi(x), shape (n, k): exact where Psi contains a component of the
            state, a least-squares fit to the training data where it does not.
        dt: time between x and y [s].
        condition_number: of the data [Psi(X); Theta] before regularization (weighted); infinite if their rows are
            dependent.
        rank: how many singular values of the data were used.
        training_errors: errors on the training data; compare with `errors` on data that were held out.
    """

    dictionary: Dictionary
    input_dictionary: Dictionary | None
    k: Matrix
    b: Matrix
    c: Matrix
    dt: float
    condition_number: float
    rank: int
    training_errors: Errors

    def __repr__(self) -> str:
        inputs = "" if self.input_dictionary is None else f", inputs={self.input_dictionary!r}"
        return (
            f"<EDMD of {self.dictionary!r}{inputs}: {self.dictionary.size} observables, rank {self.rank}, "
            f"condition number {self.condition_number:.3g}, dt={self.dt:g}>"
        )

    @classmethod
    def fit(
        cls,
        dictionary: Dictionary,
        X: ArrayLike,
        Y: ArrayLike,
        *,
        inputs: ArrayLike | None = None,
        input_dictionary: Dictionary | None = None,
        weights: ArrayLike | None = None,
        regularization: Regularization = Regularization(),  # noqa: B008 - frozen
        dt: float = 1.0,
    ) -> EDMD:
        """Fit to pairs of snapshots.

        Args:
            dictionary: Psi.
            X: states (n, m), one per column. With a dictionary that has a history, X is a trajectory and Y the same
                one step later.
            Y: their successors (n, m), one per column.
            inputs: inputs U (q, m), u_t acting between x_t and y_t; None for an autonomous system.
            input_dictionary: Theta, a dictionary of [x; u]; u itself if none is given, which makes B u of it.
            weights: positive weight of each pair's squared error, one for each column of Psi(X); all 1 if not given.
            regularization: ridge and truncation.
            dt: time between x and y [s].

        Raises:
            KoopmanError: if the data don't fit each other or the dictionary, are not finite, or overflow.
        """
        pairs = Pairs.of(dictionary, input_dictionary, X, Y, inputs)
        return cls._fitted(pairs, weights, regularization, dt)

    @classmethod
    def fit_trajectories(
        cls,
        dictionary: Dictionary,
        trajectories: Sequence[ArrayLike],
        *,
        inputs: Sequence[ArrayLike] | None = None,
        input_dictionary: Dictionary | None = None,
        regularization: Regularization = Regularization(),  # noqa: B008 - frozen
        dt: float = 1.0,
    ) -> EDMD:
        """Fit to trajectories (n, m), each of its own length, their columns consecutive states.

        Pairs never cross from one trajectory to the next. Inputs (q, m - 1), one matrix for each trajectory, act
        between its columns.

        Raises:
            KoopmanError: as `fit`, and if a trajectory is too short for one pair.
        """
        pairs = Pairs.of_trajectories(dictionary, input_dictionary, trajectories, inputs)
        return cls._fitted(pairs, None, regularization, dt)

    @classmethod
    def _fitted(cls, pairs: Pairs, weights: ArrayLike | None, how: Regularization, dt: float) -> EDMD:
        check_time_step(dt)
        data, targets = np.vstack([pairs.psi_x, pairs.theta]), pairs.psi_y
        if weights is not None:
            checked = as_vector(weights, "the weights", data.shape[1])
            if not (checked > 0.0).all():
                raise KoopmanError("the weights of pairs must be positive")
            data, targets = data * np.sqrt(checked), targets * np.sqrt(checked)
        found = solve(data, targets, how)
        size = pairs.dictionary.size
        k, b = found.k[:, :size], found.k[:, size:]
        c = _reconstruction(pairs)
        errors = _errors(pairs, k, b, c)
        return cls(pairs.dictionary, pairs.input_dictionary, k, b, c, dt, found.condition_number, found.rank, errors)

    @cached_property
    def spectrum(self) -> Spectrum:
        """Eigenvalues, left and right eigenvectors of K."""
        return spectrum(self.k)

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Koopman eigenvalues (k,) per step, by falling modulus."""
        return self.spectrum.eigenvalues

    @property
    def continuous_eigenvalues(self) -> NDArray[np.complex128]:
        """Koopman eigenvalues (k,) in continuous time, log(eigenvalue) / dt [1/s]."""
        return self.spectrum.continuous(self.dt)

    @property
    def modes(self) -> ComplexMatrix:
        """Koopman modes v_j of the full-state observable, the columns of a matrix (n, k)."""
        return np.asarray(self.c @ self.spectrum.right)

    def eigenfunctions(self, X: ArrayLike) -> ComplexMatrix:
        """Evaluate the eigenfunctions phi_j at states (n, m), one per column.

        Returns:
            Values (k, m - history), one column per state, rows in the order of the eigenvalues.
        """
        return np.asarray(self.spectrum.left @ self.dictionary(X))

    def reconstruct(self, Z: ArrayLike) -> Matrix:
        """Return the states C Z (n, m) of observables Z (k, m), one column per snapshot."""
        return self.c @ as_matrix(Z, "the observables", self.dictionary.size)

    def predict(self, start: ArrayLike, steps: int, *, inputs: ArrayLike | None = None, relift: bool = False) -> Matrix:
        """Predict the next states: shape (n, steps), one per column, the start not included.

        By default the start is lifted once and K applied again and again, C K^t Psi(x_0): this is the linear system
        that eigenvalues, eigenfunctions and modes describe, and it is exact if the dictionary's span is invariant. If
        it is not, K^t Psi(x_0) is soon no longer Psi of any state; `relift` then often errs less: each step goes back
        to the state and lifts it anew, x_t+1 = C K Psi(x_t), a nonlinear model. The first step is the same.

        Args:
            start: x_0 as a column (n, 1); if the dictionary has a history, with the states before it, (n, history + 1),
                the newest last.
            steps: how many, zero or more.
            inputs: inputs (q, steps), one column per step, for a model with inputs.
            relift: lift anew in each step.

        Raises:
            KoopmanError: on wrong shapes, or if the prediction overflows.
        """
        if not isinstance(steps, Integral) or steps < 0:
            raise KoopmanError(f"the number of steps must be whole and must not be negative, but it is {steps!r}")
        window = as_matrix(start, "the start", self.dictionary.dimension, self.dictionary.history + 1)
        u = self._inputs(inputs, steps)
        lifted, state = self.dictionary(window), window[:, -1:]
        states = np.empty((self.dictionary.dimension, steps))
        for step in range(steps):
            with np.errstate(over="ignore", invalid="ignore"):
                lifted = self.k @ lifted + self._input_part(state, u[:, step : step + 1])
                state = self.c @ lifted
            check_finite(np.vstack([lifted, state]), f"the prediction's step {step + 1}")
            states[:, step] = state[:, 0]
            if relift:
                window = np.hstack([window[:, 1:], state])
                lifted = self.dictionary(window)
        return states

    def _inputs(self, inputs: ArrayLike | None, steps: int) -> Matrix:
        if self.input_dictionary is None:
            if inputs is not None:
                raise KoopmanError("the model has no inputs, but some were given")
            return np.empty((0, steps))
        if inputs is None:
            raise KoopmanError("the model has inputs, so a prediction needs them too")
        return as_matrix(inputs, "the inputs", self.input_dictionary.dimension - self.dictionary.dimension, steps)

    def _input_part(self, state: Matrix, u: Matrix) -> Matrix:
        if self.input_dictionary is None:
            return np.zeros((self.dictionary.size, 1))
        return self.b @ self.input_dictionary(np.vstack([state, u]))

    def errors(self, X: ArrayLike, Y: ArrayLike, *, inputs: ArrayLike | None = None) -> Errors:
        """Return the one-step errors on other pairs than those of the fit (validation); arguments as in `fit`.

        Raises:
            KoopmanError: as `fit`.
        """
        if inputs is not None and self.input_dictionary is None:
            raise KoopmanError("the model has no inputs, but some were given")
        if inputs is None and self.input_dictionary is not None:
            raise KoopmanError("the model has inputs, so its errors need them too")
        pairs = Pairs.of(self.dictionary, self.input_dictionary, X, Y, inputs)
        return _errors(pairs, self.k, self.b, self.c)


def _errors(pairs: Pairs, k: Matrix, b: Matrix, c: Matrix) -> Errors:
    with np.errstate(over="ignore", invalid="ignore"):
        predicted = k @ pairs.psi_x + b @ pairs.theta
        lifted, state = pairs.psi_y - predicted, pairs.y - c @ predicted
    check_finite(lifted, "the error")
    check_finite(state, "the error")
    return Errors(_root_mean_square(lifted), _root_mean_square(state))


def _root_mean_square(columns: Matrix) -> float:
    largest = float(np.abs(columns).max(initial=0.0))
    if largest == 0.0:
        return 0.0
    scaled = columns / largest
    return largest * float(np.sqrt((scaled**2).sum() / columns.shape[1]))


def _reconstruction(pairs: Pairs) -> Matrix:
    """Return C (n, k) with x = C Psi(x)."""
    rows = pairs.dictionary.state_rows
    c = np.zeros((len(rows), pairs.dictionary.size))
    missing = [i for i, row in enumerate(rows) if row is None]
    for i, row in enumerate(rows):
        if row is not None:
            c[i, row] = 1.0
    if missing:
        c[missing] = solve(pairs.psi_x, pairs.x[missing], Regularization()).k
    return c
