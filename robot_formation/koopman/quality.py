"""How far a Koopman matrix is to be believed: the consistency index of a dictionary, and residuals of eigenvalues.

Sources: Haseli and Cortes, "Temporal forward-backward consistency, not residual error, measures the prediction
accuracy of extended dynamic mode decomposition" (arXiv 2207.07719); Colbrook and Townsend, "Rigorous data-driven
computation of spectral properties of Koopman operators for dynamical systems" (ResDMD, arXiv 2111.14889).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robot_formation.koopman.linear_algebra import KoopmanError, Matrix, as_matrix, as_vector
from robot_formation.koopman.spectrum import spectrum

# An eigenvalue is called spurious where its squared residual is beyond this many times what noise alone leaves, or
# where its residual is so large: eigenvalues made of nothing but noise have one near 1.
_BEYOND_NOISE, _LARGE_RESIDUAL = 2.0, 0.7


@dataclass(frozen=True)
class EigenvalueQuality:
    """What data say of an eigenvalue of K.

    Attributes:
        eigenvalue: lambda.
        period: 2 pi / |arg(lambda)| timesteps; None if it is real and positive, which is no oscillation.
        residual: sqrt(mean |phi(y) - lambda phi(x)|^2 / mean |phi(x)|^2), phi its eigenfunction, over the pairs.
        noise: what measurement noise alone leaves of such a residual if the observables' noises are independent of each
            other. Delays share displacements; with them it is an upper estimate.
        spurious: whether the residual is above 0.7, so that the eigenfunction's next value hardly follows from the
            last, or its square more than twice the noise's: no eigenvalue of the system's, or none that the data show.
    """

    eigenvalue: complex
    period: float | None
    residual: float
    noise: float
    spurious: bool


def consistency_index(psi_x: ArrayLike, psi_y: ArrayLike) -> float | None:
    """Return the consistency index of a dictionary on pairs: the largest eigenvalue of I - K_forward K_backward.

    0 means that the span of the dictionary is invariant on these data. Its square root bounds the relative root mean
    square error of one-step forecasts of every function in the span, whatever the basis.

    Args:
        psi_x: (k, m) observables of m states.
        psi_y: (k, m) observables of their successors.

    Returns:
        The index, from 0 to 1; None unless there are more pairs than observables: any K fits fewer.

    Raises:
        KoopmanError: if the pairs don't fit each other, or are not finite.
    """
    x, y = _pairs(psi_x, psi_y)
    if x.shape[1] <= x.shape[0]:
        return None
    forward, backward = y @ np.linalg.pinv(x), x @ np.linalg.pinv(y)
    identity = x @ np.linalg.pinv(x)  # the unit matrix on the observables that are independent on these data
    largest = float(np.linalg.eigvals(identity - backward @ forward).real.max())
    return min(max(largest, 0.0), 1.0)


def eigenvalue_qualities(
    k: ArrayLike, psi_x: ArrayLike, psi_y: ArrayLike, noise: ArrayLike
) -> list[EigenvalueQuality] | None:
    """Return the residual of every eigenvalue of K on pairs, ordered by falling modulus.

    Args:
        k: (k, k) Koopman matrix.
        psi_x: (k, m) observables of m states.
        psi_y: (k, m) observables of their successors.
        noise: (k,) standard deviation of each observable's measurement noise.

    Returns:
        None unless there are more pairs than observables: residuals in the sample say nothing then.

    Raises:
        KoopmanError: if K and the pairs don't fit each other, or are not finite.
    """
    x, y = _pairs(psi_x, psi_y)
    size, count = x.shape
    matrix, sigmas = as_matrix(k, "K", size, size), as_vector(noise, "the noise", size)
    if count <= size:
        return None
    found = spectrum(matrix)
    qualities = []
    for value, row in zip(found.eigenvalues.tolist(), found.left, strict=True):
        phi_x, phi_y = row @ x, row @ y
        length = float(np.mean(np.abs(phi_x) ** 2))
        squared = float(np.mean(np.abs(phi_y - value * phi_x) ** 2)) / length if length > 0.0 else float("inf")
        of_noise = float(np.sum(np.abs(row * sigmas) ** 2)) * (1.0 + abs(value) ** 2) / length if length > 0.0 else 0.0
        angle = abs(float(np.angle(value)))
        qualities.append(
            EigenvalueQuality(
                eigenvalue=value,
                period=2.0 * np.pi / angle if angle > 1e-9 else None,
                residual=min(squared, 1e300) ** 0.5,
                noise=min(of_noise, 1e300) ** 0.5,
                spurious=squared > _BEYOND_NOISE * of_noise or squared > _LARGE_RESIDUAL**2,
            )
        )
    return qualities


def _pairs(psi_x: ArrayLike, psi_y: ArrayLike) -> tuple[Matrix, Matrix]:
    x = as_matrix(psi_x, "Psi(X)")
    if not x.size:
        raise KoopmanError("there are no pairs")
    return x, as_matrix(psi_y, "Psi(Y)", x.shape[0], x.shape[1])
