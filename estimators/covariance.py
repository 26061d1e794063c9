"""Square roots of covariances, in the form that filterpy's sigma points need."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array

_LEAST = 1e-12  # variance that a covariance keeps in every direction


def square_root(P: Array) -> Array:
    """Upper triangular U (n, n) with U' U = P (n, n), or of the nearest positive definite matrix if P is not one."""
    P = 0.5 * (P + P.T)
    try:
        lower: Array = np.asarray(np.linalg.cholesky(P), np.float64)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(P)
        upper: Array = np.linalg.qr(np.sqrt(np.maximum(values, _LEAST))[:, None] * vectors.T)[1]
        lower = np.asarray(upper.T, np.float64)
    return lower.T
