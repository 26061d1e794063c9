"""Steps that several Kalman filters share: external prediction, square roots of covariances, invariant updates.

**Measurement update of an invariant filter**: the error xi of X = X^ Exp(xi) is Gaussian, mean zero, covariance P, and

    nu = H xi + n,   S = H P H' + R,   K = P H' S^-1,   X^ <- X^ Exp(K nu),   P <- (I - K H) P (I - K H)' + K R K'

(A. Barrau, S. Bonnabel, The Invariant Extended Kalman Filter as a Stable Observer, IEEE TAC 62(4), 2017).
"""

from __future__ import annotations

from typing import Any

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


def condition(P: Array, H: Array, nu: Array, R: Array) -> tuple[Array, Array, float]:
    """Condition an error of covariance P (n, n) on the innovation nu (m,) with H (m, n) and noise R (m, m).

    Returns K nu (n,), the covariance (n, n) and NIS, nu' S^-1 nu. Raises LinAlgError where S is singular.
    """
    solved = np.linalg.solve(H @ P @ H.T + R, np.column_stack([H @ P, nu]))  # S^-1 (H P, nu)
    K = solved[:, :-1].T
    kept = np.eye(len(P)) - K @ H
    after = kept @ P @ kept.T + K @ R @ K.T
    return K @ nu, 0.5 * (after + after.T), float(nu @ solved[:, -1])


def external_prediction_ekf(states: int, readings: int) -> Any:
    """Build the filter for n ``states`` and m ``readings``.

    Its ``predict(x)`` takes the predicted state x (n,), from the equations of motion, and propagates the covariance:
    P <- F P F' + Q with its ``F`` (n, n) and ``Q`` (n, n). States and readings must both be flat arrays: filterpy
    broadcasts a flat array and a column to a square matrix.
    """
    from mathnavi.estimators.external_prediction_ekf import ExternalPredictionEkf  # takes 0.7 s to import

    return ExternalPredictionEkf(states, readings)
