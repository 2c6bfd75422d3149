"""What tests of the Koopman library share: oracles, and systems whose Koopman operator is known."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MU, LAMBDA, DT = -0.2, -1.0, 0.1
# x2 - SLOPE x1^2 decays with LAMBDA.
SLOPE = LAMBDA / (LAMBDA - 2 * MU)


def slow_manifold(X: Array, time: float = DT) -> Array:
    """The flow of x1' = mu x1, x2' = lambda (x2 - x1^2) for a time; columns are states."""
    x1, x2 = X
    later = np.exp(MU * time) * x1
    return np.array([later, SLOPE * later**2 + np.exp(LAMBDA * time) * (x2 - SLOPE * x1**2)])


def batch(
    pairs: Sequence[tuple[Array, Array]],
    forgetting: float = 1.0,
    prior_weight: float | Array = 0.0,
    prior_k: Array | None = None,
    window: int | None = None,
) -> Array:
    """K of weighted least squares with a prior, by numpy's lstsq; the newest pair has weight 1."""
    rows, outputs = len(pairs[0][0]), len(pairs[0][1])
    base = np.zeros((outputs, rows)) if prior_k is None else prior_k
    used = pairs if window is None else pairs[-window:]
    weights = np.sqrt(forgetting) ** np.arange(len(used) - 1, -1, -1)
    prior = np.diag(np.sqrt(np.broadcast_to(prior_weight, rows) * forgetting ** len(pairs)))
    xs = np.vstack([prior, np.array([x for x, _ in used]) * weights[:, None]])
    errors = np.array([y - base @ x for x, y in used]) * weights[:, None]
    fitted: Array = np.linalg.lstsq(xs, np.vstack([np.zeros((rows, outputs)), errors]), rcond=1e-12)[0]
    found: Array = base + fitted.T
    return found


def well_conditioned(rng: np.random.Generator, dimension: int, outputs: int, count: int) -> list[tuple[Array, Array]]:
    """Pairs of which any `dimension` in a row are nearly orthogonal."""
    base = np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]
    xs = [base[:, t % dimension] + rng.normal(0.0, 0.2 / dimension, dimension) for t in range(count)]
    return [(x, rng.normal(size=outputs)) for x in xs]
