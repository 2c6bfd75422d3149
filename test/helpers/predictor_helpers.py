"""What tests of the predictors share."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from robot_formation.koopman.predictors import Predictor, PredictorParameters

Array = npt.NDArray[np.float64]
Timestep = tuple[Array, Array | None, Array | None]
"""Displacement, residual and commanded displacement."""

HISTORY = [(0.010, 0.050), (0.012, 0.049), (0.015, 0.051), (0.017, 0.047), (0.021, 0.048), (0.022, 0.045)]


def predictor(name: str, **values: Any) -> Predictor:
    return Predictor(PredictorParameters(name=name, **values))


def whole(x: Array | tuple[float, float], turn: float = 0.0) -> Array:
    """(u, v) with a turn."""
    return np.append(x, turn)


def forecasts(name: str, history: Sequence[Array | tuple[float, float]] | Array, **values: Any) -> Array:
    """The forecast (u, v) after each displacement, without residuals and turns."""
    found = predictor(name, **values)
    means = []
    for x in history:
        found.observe(whole(x))
        means.append(found.predict().mean[:2])
    return np.array(means)


def timesteps(count: int, seed: int = 0, turn: float = 0.0) -> list[Timestep]:
    """Displacement, residual and commanded displacement of noisy timesteps; some of the latter two are unknown.

    Turns are zero, or noisy about `turn`.
    """
    rng, turns = np.random.default_rng(seed), np.random.default_rng((seed, 1))

    def with_turn(x: Array, mean: float) -> Array:
        return whole(x, mean + turns.normal(0.0, 0.005) if turn else 0.0)

    found: list[Timestep] = []
    for t in range(count):
        x = np.array([0.01 * np.sin(t / 5.0), 0.05]) + rng.normal(0.0, (0.003, 0.002))
        r = None if rng.random() < 0.15 else rng.normal(0.0, (0.006, 0.003))
        c = None if rng.random() < 0.15 else x + np.array([-0.003, 0.002]) + rng.normal(0.0, 0.001, 2)
        whole_x = with_turn(x, turn)
        found.append((whole_x, None if r is None else with_turn(r, 0.0), None if c is None else whole(c, whole_x[2])))
    return found


def solve_2_by_2(x1: Array, x2: Array, y1: Array, y2: Array) -> Array:
    """K with K x1 = y1 and K x2 = y2, by Cramer's rule."""
    det = x1[0] * x2[1] - x2[0] * x1[1]
    inverse: Array = np.array([[x2[1], -x2[0]], [-x1[1], x1[0]]]) / det
    found: Array = np.column_stack([y1, y2]) @ inverse
    return found
