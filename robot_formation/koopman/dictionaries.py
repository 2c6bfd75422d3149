"""Dictionaries: vectors Psi of observables psi_1, ..., psi_k of a state, the functions that K acts on.

Convention of the paper ("Koopman operator theory and EDMD"): columns are snapshots, so a dictionary maps states X of
shape (n, m) to Psi(X) of shape (k, m). `KoopmanRegressor` alone has them in rows, as scikit-learn does. Dictionaries
are put together with `+` (`Concatenation`) and `*` (`Product`), and print as they are written:

    Identity(2) + Constant(2) + Monomials([(2, 0)])     observables x1, x2, 1, x1^2

A class of your own needs the members of `Dictionary` only; `Observables` brings the checks and the operators.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, as_matrix

# More observables than any laptop can decompose: a mistake in dimension or degree.
_LARGEST_SIZE = 10_000
_MOST_SHOWN = 8  # rows of exponents in a `repr`


class Dictionary(Protocol):
    """Observables of a state of length `dimension`."""

    @property
    def dimension(self) -> int:
        """Length n of a state."""

    @property
    def history(self) -> int:
        """How many earlier states a column needs; if not zero, the columns of X are consecutive states."""

    @property
    def size(self) -> int:
        """Number k of observables."""

    @property
    def names(self) -> tuple[str, ...]:
        """The observables, readable, k of them; the constant observable is called "1"."""

    @property
    def state_rows(self) -> tuple[int | None, ...]:
        """For each of the n components of the state the row of Psi that is it, None where there is none."""

    def __call__(self, X: ArrayLike) -> Matrix:
        """Lift states (n, m), one per column, to observables (k, m - history), one column per state.

        Raises:
            KoopmanError: on a wrong shape, a value that is not finite, or an observable that overflows.
        """


class Observables(ABC):
    """What all dictionaries here have in common; a subclass says its names, the state's rows and `_lift`."""

    def __init__(
        self, dimension: int, names: Sequence[str], state_rows: Sequence[int | None] = (), history: int = 0
    ) -> None:
        if dimension < 1:
            raise KoopmanError(f"a dictionary needs states of at least one component, not {dimension}")
        self._dimension = dimension
        self._names = tuple(names)
        self._state_rows = tuple(state_rows) or (None,) * dimension
        self._history = history

    @property
    def dimension(self) -> int:
        """See `Dictionary`."""
        return self._dimension

    @property
    def history(self) -> int:
        """See `Dictionary`."""
        return self._history

    @property
    def size(self) -> int:
        """See `Dictionary`."""
        return len(self._names)

    @property
    def names(self) -> tuple[str, ...]:
        """See `Dictionary`."""
        return self._names

    @property
    def state_rows(self) -> tuple[int | None, ...]:
        """See `Dictionary`."""
        return self._state_rows

    def __call__(self, X: ArrayLike) -> Matrix:
        """See `Dictionary`."""
        states = as_matrix(X, "the states", self.dimension)
        if states.shape[1] < self.history + 1:
            raise KoopmanError(
                f"the states must be at least {self.history + 1} consecutive columns, not {states.shape[1]}"
            )
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            lifted = self._lift(states)
        good = np.isfinite(lifted).all(axis=1)
        if not good.all():
            raise KoopmanError(f"the observable {self.names[int(np.argmin(good))]} overflows: scale the states")
        return lifted

    @abstractmethod
    def _lift(self, X: Matrix) -> Matrix:
        """Lift finite states (n, m), m > history, to (k, m - history); overflow may pass, it is caught."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.dimension} variables: {self.size} observables>"

    def __add__(self, other: Dictionary) -> Concatenation:
        """Return the observables of both."""
        return Concatenation(self, other)

    def __mul__(self, other: Dictionary) -> Product:
        """Return all products of an observable of this with one of the other."""
        return Product(self, other)


def _variables(dimension: int, variables: Sequence[str] | None) -> tuple[str, ...]:
    if variables is None:
        return tuple(f"x{i + 1}" for i in range(dimension))
    if len(variables) != dimension or "1" in variables:
        raise KoopmanError(f"there must be {dimension} names of variables, none of them '1', not {list(variables)}")
    return tuple(variables)


class Identity(Observables):
    """The state itself; EDMD with it is plain DMD. Observables: x1, ..., xn, or the given names."""

    def __init__(self, dimension: int, variables: Sequence[str] | None = None) -> None:
        super().__init__(dimension, _variables(dimension, variables), range(dimension))

    def __repr__(self) -> str:
        return f"Identity({self.dimension}{_named(self.names)})"

    def _lift(self, X: Matrix) -> Matrix:
        return np.array(X)


class Constant(Observables):
    """The observable 1, which makes K affine in the others: it learns a steady offset."""

    def __init__(self, dimension: int) -> None:
        super().__init__(dimension, ["1"])

    def __repr__(self) -> str:
        return f"Constant({self.dimension})"

    def _lift(self, X: Matrix) -> Matrix:
        return np.ones((1, X.shape[1]))


class Monomials(Observables):
    """Products of powers of the state's components, one for each row of exponents, in the order given."""

    def __init__(self, exponents: Sequence[Sequence[int]], variables: Sequence[str] | None = None) -> None:
        """Set exponents (k, n): integers, zero or positive.

        Raises:
            KoopmanError: if they are something else.
        """
        table = np.array(exponents)
        if table.ndim != 2 or table.size == 0 or table.dtype.kind not in "iu" or table.min() < 0:
            raise KoopmanError("exponents must be a table of integers that are not negative, one row per observable")
        dimension = table.shape[1]
        letters = _variables(dimension, variables)
        units = [tuple(int(i == j) for j in range(dimension)) for i in range(dimension)]
        rows = [tuple(int(power) for power in row) for row in table]
        super().__init__(
            dimension,
            [_monomial_name(row, letters) for row in rows],
            [rows.index(unit) if unit in rows else None for unit in units],
        )
        self._exponents = table
        shown = table.tolist() if len(table) <= _MOST_SHOWN else f"<{len(table)} rows of exponents>"
        self._written = f"Monomials({shown}{_named(letters)})"

    @classmethod
    def to_degree(
        cls, dimension: int, degree: int, *, lowest: int = 1, variables: Sequence[str] | None = None
    ) -> Monomials:
        """Make all monomials whose total degree is from `lowest` (0 includes the constant) to `degree`.

        Order (graded lexicographic): by total degree, and within one degree by falling power of x1, then of x2, ...;
        for two variables x1, x2, x1^2, x1 x2, x2^2, x1^3, ...

        Raises:
            KoopmanError: if there is no such monomial, or more than ten thousand.
        """
        if dimension < 1 or not 0 <= lowest <= degree:
            raise KoopmanError(
                "monomials need a dimension of at least 1 and degrees 0 <= lowest <= degree, "
                f"not dimension {dimension}, lowest {lowest}, degree {degree}"
            )
        if math.comb(dimension + degree, degree) > _LARGEST_SIZE:
            raise KoopmanError(f"monomials of {dimension} variables to degree {degree} are too many: lower the degree")
        exponents = [
            [chosen.count(i) for i in range(dimension)]
            for total in range(lowest, degree + 1)
            for chosen in combinations_with_replacement(range(dimension), total)
        ]
        monomials = cls(exponents, variables)
        from_degree = f", lowest={lowest}" if lowest != 1 else ""
        named = _named(_variables(dimension, variables), "variables=")
        monomials._written = f"Monomials.to_degree({dimension}, {degree}{from_degree}{named})"
        return monomials

    def __repr__(self) -> str:
        return self._written

    def _lift(self, X: Matrix) -> Matrix:
        products: Matrix = np.prod(X[None, :, :] ** self._exponents[:, :, None], axis=1)
        return products


def _named(letters: Sequence[str], keyword: str = "") -> str:
    """Write names of variables as the last argument of a constructor; nothing if they are the usual ones."""
    return "" if tuple(letters) == _variables(len(letters), None) else f", {keyword}{list(letters)}"


def _monomial_name(powers: Sequence[int], letters: Sequence[str]) -> str:
    factors = [f"{x}^{p}" if p > 1 else x for x, p in zip(letters, powers, strict=True) if p]
    return " ".join(factors) or "1"


class Rows(Observables):
    """A dictionary of some components only: its state is made of the given rows of a longer one."""

    def __init__(self, dictionary: Dictionary, rows: Sequence[int], dimension: int) -> None:
        """Set rows 0..dimension-1, as many as the dictionary's states are long.

        Raises:
            KoopmanError: on other rows.
        """
        rows = tuple(rows)
        if len(rows) != dictionary.dimension or not all(0 <= row < dimension for row in rows):
            raise KoopmanError(
                f"{dictionary.dimension} rows between 0 and {dimension - 1} must be chosen, not {list(rows)}"
            )
        inner = [dictionary.state_rows[rows.index(i)] if i in rows else None for i in range(dimension)]
        super().__init__(dimension, dictionary.names, inner, dictionary.history)
        self._dictionary = dictionary
        self._rows = list(rows)

    def __repr__(self) -> str:
        return f"Rows({self._dictionary!r}, {self._rows}, {self.dimension})"

    def _lift(self, X: Matrix) -> Matrix:
        return self._dictionary(X[self._rows])


class Inputs(Rows):
    """The inputs u (p) of stacked vectors [x; u] with a state x (n). Observables: u1, ..., up, or the given names."""

    def __init__(self, states: int, inputs: int, variables: Sequence[str] | None = None) -> None:
        letters = [f"u{i + 1}" for i in range(inputs)] if variables is None else variables
        super().__init__(Identity(inputs, letters), range(states, states + inputs), states + inputs)
        named = "" if variables is None else f", {list(variables)}"
        self._written = f"Inputs({states}, {inputs}{named})"

    def __repr__(self) -> str:
        return self._written


class DelayEmbedding(Observables):
    """Observables of the last d + 1 states z_t = [x_t; x_t-1; ...; x_t-d] of a trajectory (Hankel DMD, Takens).

    X is a trajectory, its columns consecutive: m columns give m - d. The state to be predicted stays x_t, of length n.
    """

    def __init__(
        self,
        dimension: int,
        delays: int,
        dictionary: Dictionary | None = None,
        variables: Sequence[str] | None = None,
    ) -> None:
        """Embed states of length `dimension` with `delays` past states.

        Args:
            dimension: n.
            delays: d >= 0.
            dictionary: observables of z, whose length is n (d + 1); z itself if none is given.
            variables: names of the components of x, for z itself: "x1" and "x1(t-1)" and so on.

        Raises:
            KoopmanError: if these do not fit each other.
        """
        if delays < 0 or delays > _LARGEST_SIZE:
            raise KoopmanError(f"the number of delays must be between 0 and {_LARGEST_SIZE}, not {delays}")
        inner = "" if dictionary is None else f", {dictionary!r}"
        if dictionary is None:
            letters = _variables(dimension, variables)
            inner = _named(letters, "variables=")
            late = [f"{x}(t-{delay})" for delay in range(1, delays + 1) for x in letters]
            dictionary = Identity(dimension * (delays + 1), [*letters, *late])
        if dictionary.dimension != dimension * (delays + 1) or dictionary.history:
            raise KoopmanError(
                f"a dictionary of {delays} delays must itself have none, and take vectors of length "
                f"{dimension * (delays + 1)}, not {dictionary.dimension}"
            )
        super().__init__(dimension, dictionary.names, dictionary.state_rows[:dimension], delays)
        self._dictionary = dictionary
        self._written = f"DelayEmbedding({dimension}, {delays}{inner})"

    def __repr__(self) -> str:
        return self._written

    def _lift(self, X: Matrix) -> Matrix:
        columns = X.shape[1] - self.history
        stacked = [X[:, self.history - delay :][:, :columns] for delay in range(self.history + 1)]
        return self._dictionary(np.vstack(stacked))


class Concatenation(Observables):
    """The observables of several dictionaries of the same state, one after the other."""

    def __init__(self, *parts: Dictionary) -> None:
        if not parts or len({part.dimension for part in parts}) != 1:
            raise KoopmanError("only dictionaries of states of the same length can be concatenated")
        starts = np.cumsum([0, *(part.size for part in parts)])
        rows: list[int | None] = [None] * parts[0].dimension
        for start, part in zip(starts, parts, strict=False):
            for i, row in enumerate(part.state_rows):
                if rows[i] is None and row is not None:
                    rows[i] = int(start) + row
        names = [name for part in parts for name in part.names]
        super().__init__(parts[0].dimension, names, rows, max(part.history for part in parts))
        self._parts = parts

    def __repr__(self) -> str:
        return " + ".join(map(repr, self._parts)) if len(self._parts) > 1 else f"Concatenation({self._parts[0]!r})"

    def _lift(self, X: Matrix) -> Matrix:
        return np.vstack([part(X[:, self.history - part.history :]) for part in self._parts])


class Product(Observables):
    """All products of an observable of one dictionary with one of another of the same state.

    Order: the first observable of `left` times each of `right`, then the second, ... Products that occur twice, as x1
    x2 and x2 x1 do, stay: the fit then takes the solution of least norm.
    """

    def __init__(self, left: Dictionary, right: Dictionary) -> None:
        if left.dimension != right.dimension:
            raise KoopmanError("only dictionaries of states of the same length can be multiplied")
        names = [" ".join(f for f in (a, b) if f != "1") or "1" for a in left.names for b in right.names]
        rows: list[int | None] = [None] * left.dimension
        for i, (a, b) in enumerate(zip(left.state_rows, right.state_rows, strict=True)):
            if b is not None and "1" in left.names:
                rows[i] = left.names.index("1") * right.size + b
            elif a is not None and "1" in right.names:
                rows[i] = a * right.size + right.names.index("1")
        super().__init__(left.dimension, names, rows, max(left.history, right.history))
        self._left, self._right = left, right

    def __repr__(self) -> str:
        return " * ".join(f"({p!r})" if isinstance(p, Concatenation) else repr(p) for p in (self._left, self._right))

    def _lift(self, X: Matrix) -> Matrix:
        a, b = (part(X[:, self.history - part.history :]) for part in (self._left, self._right))
        return np.reshape(a[:, None, :] * b[None, :, :], (self.size, -1))
