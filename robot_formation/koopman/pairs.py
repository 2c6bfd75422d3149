"""Pairs of snapshots, checked and lifted by a dictionary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.koopman.dictionaries import Dictionary, Inputs
from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, as_matrix


@dataclass(frozen=True, eq=False)
class Pairs:
    """m pairs of a state and its successor: x, y (n, m), psi_x, psi_y (k, m), theta (p, m), p = 0 without inputs."""

    dictionary: Dictionary
    input_dictionary: Dictionary | None
    x: Matrix
    y: Matrix
    psi_x: Matrix
    psi_y: Matrix
    theta: Matrix

    @classmethod
    def of(
        cls,
        dictionary: Dictionary,
        input_dictionary: Dictionary | None,
        X: ArrayLike,
        Y: ArrayLike,
        inputs: ArrayLike | None,
    ) -> Pairs:
        """Lift X and Y (n, m) and inputs (q, m); u itself is the observable of inputs if no dictionary is given.

        Raises:
            KoopmanError: if they don't fit each other or the dictionaries, or are not finite.
        """
        n, history = dictionary.dimension, dictionary.history
        x = as_matrix(X, "X", n)
        y = as_matrix(Y, "Y", n, x.shape[1])
        if x.shape[1] <= history:
            raise KoopmanError(f"{x.shape[1]} pairs are too few: the dictionary needs at least {history + 1}")
        if history and not (x[:, 1:] == y[:, :-1]).all():
            raise KoopmanError("a dictionary with delays needs X to be a trajectory, and Y the same one step later")
        psi_x, psi_y = dictionary(x), dictionary(y)
        theta, known = _theta(input_dictionary, x, inputs)
        return cls(dictionary, known, x[:, history:], y[:, history:], psi_x, psi_y, theta[:, history:])

    @classmethod
    def of_trajectories(
        cls,
        dictionary: Dictionary,
        input_dictionary: Dictionary | None,
        trajectories: Sequence[ArrayLike],
        inputs: Sequence[ArrayLike] | None,
    ) -> Pairs:
        """Lift the pairs of neighbouring columns of trajectories (n, m) with inputs (q, m - 1).

        Raises:
            KoopmanError: as `of`, if a trajectory is too short, or if there are not as many inputs as trajectories.
        """
        if isinstance(trajectories, np.ndarray) and trajectories.ndim == 2:
            raise KoopmanError(
                f"trajectories must be a list of matrices (n, m), not one of shape {trajectories.shape}: "
                "put a single trajectory into a list"
            )
        if not len(trajectories) or (inputs is not None and len(inputs) != len(trajectories)):
            raise KoopmanError("there must be at least one trajectory, and as many inputs if there are any")
        parts = []
        for i, trajectory in enumerate(trajectories):
            path = as_matrix(trajectory, f"trajectory {i + 1}", dictionary.dimension)
            if path.shape[1] < dictionary.history + 2:
                raise KoopmanError(
                    f"trajectory {i + 1} is too short: it needs {dictionary.history + 2} states at least"
                )
            u = None if inputs is None else inputs[i]
            parts.append(cls.of(dictionary, input_dictionary, path[:, :-1], path[:, 1:], u))
        if len({part.theta.shape[0] for part in parts}) != 1:
            raise KoopmanError("all trajectories must have the same number of inputs")
        joined = (np.hstack([getattr(part, name) for part in parts]) for name in ("x", "y", "psi_x", "psi_y", "theta"))
        return cls(dictionary, parts[0].input_dictionary, *joined)


def _theta(dictionary: Dictionary | None, x: Matrix, inputs: ArrayLike | None) -> tuple[Matrix, Dictionary | None]:
    if inputs is None:
        if dictionary is not None:
            raise KoopmanError("a dictionary of inputs was given, but no inputs")
        return np.empty((0, x.shape[1])), None
    u = as_matrix(inputs, "the inputs", columns=x.shape[1])
    n = x.shape[0]
    known = dictionary if dictionary is not None else Inputs(n, u.shape[0])
    if known.dimension != n + u.shape[0] or known.history:
        raise KoopmanError(
            f"the dictionary of inputs must have no delays and take [x; u] of length {n + u.shape[0]}, "
            f"not {known.dimension}"
        )
    return known(np.vstack([x, u])), known
