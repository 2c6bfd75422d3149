"""Eigenvalues and eigenvectors of a Koopman matrix K, in the form in which eigenfunctions and modes need them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_formation.koopman.linear_algebra import ComplexMatrix, KoopmanError, Matrix, as_matrix, check_time_step

# Eigenvectors that are dependent to this degree come from a defective K; the part they share is used once.
_DEPENDENT = 1e-10


@dataclass(frozen=True, eq=False)
class Spectrum:
    """K = V diag(eigenvalues) W, ordered by falling modulus, of a conjugate pair first the one above the real axis.

    Attributes:
        eigenvalues: shape (k,).
        left: W, shape (k, k), the left eigenvectors as rows, W K = diag(eigenvalues) W, each scaled so that its
            largest element is 1. Row j applied to Psi(x) is the Koopman eigenfunction phi_j(x).
        right: V = W^-1, shape (k, k), the right eigenvectors as columns. If K is defective (has too few eigenvectors)
            it is the pseudo-inverse, and V diag(eigenvalues) W is not K.
        condition_number: of W; large (above about 1e8, or infinite) means that K is defective or nearly so.
    """

    eigenvalues: NDArray[np.complex128]
    left: ComplexMatrix
    right: ComplexMatrix
    condition_number: float

    def __repr__(self) -> str:
        values = np.array2string(self.eigenvalues, precision=4, threshold=6, edgeitems=2, max_line_width=1000)
        return (
            f"<Spectrum of {len(self.eigenvalues)} eigenvalues {values}, condition number {self.condition_number:.3g}>"
        )

    def continuous(self, dt: float) -> NDArray[np.complex128]:
        """Return the eigenvalues in continuous time, log(eigenvalue) / dt, for samples dt seconds apart.

        Their imaginary parts lie in (-pi, pi] / dt: faster oscillations can't be told from slower ones. An eigenvalue
        of zero has the real part -infinity.

        Raises:
            KoopmanError: if dt is not positive and finite.
        """
        check_time_step(dt)
        with np.errstate(divide="ignore"):
            moduli = np.log(np.abs(self.eigenvalues))
        return np.asarray(moduli / dt + 1j * (np.angle(self.eigenvalues) / dt), dtype=complex)


def spectrum(k: Matrix) -> Spectrum:
    """Decompose a square K (k, k).

    Raises:
        KoopmanError: if K is empty, not square or not finite, or its eigenvalues can't be found.
    """
    k = as_matrix(k, "K")
    if k.shape[0] != k.shape[1] or not k.size:
        raise KoopmanError(f"only a square K of one row at least has eigenvalues, not one of shape {k.shape}")
    try:
        found, columns = np.linalg.eig(k.T)
        order = np.lexsort((-found.imag, -np.abs(found)))
        left = columns.T.astype(complex)[order]
        largest = np.argmax(np.abs(left), axis=1)
        left = left / left[np.arange(len(left)), largest][:, None]
        right = np.linalg.pinv(left, rcond=_DEPENDENT)
        condition = float(np.linalg.cond(left))
    except np.linalg.LinAlgError as error:
        raise KoopmanError(f"the eigenvalues of K could not be found ({error}): scale the data") from error
    return Spectrum(found.astype(complex)[order], left, right, condition)
