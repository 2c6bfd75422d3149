"""What tests of the predictors share."""

import numpy as np

from robot_formation.koopman.predictors import Predictor, PredictorParameters

HISTORY = [(0.010, 0.050), (0.012, 0.049), (0.015, 0.051), (0.017, 0.047), (0.021, 0.048), (0.022, 0.045)]


def predictor(name, **values):
    return Predictor(PredictorParameters(name=name, **values))


def forecasts(name, history, **values):
    """The forecast after each displacement, without residuals."""
    found = predictor(name, **values)
    means = []
    for x in history:
        found.observe(np.array(x))
        means.append(found.predict().mean)
    return np.array(means)


def timesteps(count, seed=0):
    """Displacement, residual and commanded displacement of noisy timesteps; some of the latter two are unknown."""
    rng = np.random.default_rng(seed)
    found = []
    for t in range(count):
        x = np.array([0.01 * np.sin(t / 5.0), 0.05]) + rng.normal(0.0, (0.003, 0.002))
        r = None if rng.random() < 0.15 else rng.normal(0.0, (0.006, 0.003))
        c = None if rng.random() < 0.15 else x + np.array([-0.003, 0.002]) + rng.normal(0.0, 0.001, 2)
        found.append((x, r, c))
    return found


def solve_2_by_2(x1, x2, y1, y2):
    """K with K x1 = y1 and K x2 = y2, by Cramer's rule."""
    det = x1[0] * x2[1] - x2[0] * x1[1]
    inverse = np.array([[x2[1], -x2[0]], [-x1[1], x1[0]]]) / det
    return np.column_stack([y1, y2]) @ inverse
