"""Measurement update of an invariant filter: the error xi of X = X^ Exp(xi) is Gaussian, mean zero, covariance P, and

    nu = H xi + n,   S = H P H' + R,   K = P H' S^-1,   X^ <- X^ Exp(K nu),   P <- (I - K H) P (I - K H)' + K R K'

(A. Barrau, S. Bonnabel, The Invariant Extended Kalman Filter as a Stable Observer, IEEE TAC 62(4), 2017).
"""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array


def condition(P: Array, H: Array, nu: Array, R: Array) -> tuple[Array, Array, float]:
    """Condition an error of covariance P (n, n) on the innovation nu (m,) with H (m, n) and noise R (m, m).

    Returns K nu (n,), the covariance (n, n) and NIS, nu' S^-1 nu. Raises LinAlgError where S is singular.
    """
    solved = np.linalg.solve(H @ P @ H.T + R, np.column_stack([H @ P, nu]))  # S^-1 (H P, nu)
    K = solved[:, :-1].T
    kept = np.eye(len(P)) - K @ H
    after = kept @ P @ kept.T + K @ R @ K.T
    return K @ nu, 0.5 * (after + after.T), float(nu @ solved[:, -1])
