"""Linear systems under white noise, x' = A x + w with w of covariance W per second, from one time to another."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Array

_LONGEST = 4.0  # of a step times the norm of A: beyond it exp(-A h) loses digits, and overflows in the end


def discretised(A: Array, W: Array, h: float) -> tuple[Array, Array]:
    """F (n, n) and Q (n, n) over h [s]: x(h) = F x(0) + noise of covariance Q, exact.

    By the matrix exponential of C. F. Van Loan (IEEE Trans. Autom. Control 23, 1978) over a short step, which is then
    doubled as often as it takes: F(2 s) = F(s)^2, Q(2 s) = F(s) Q(s) F(s)' + Q(s).
    """
    from scipy.linalg import expm  # takes a while to import

    n = len(A)
    doublings = max(0, math.ceil(math.log2(max(1.0, h * float(np.abs(A).sum(axis=1).max()) / _LONGEST))))
    exponential = expm(h / 2**doublings * np.block([[-A, W], [np.zeros((n, n)), A.T]]))
    F = exponential[n:, n:].T
    Q = F @ exponential[:n, n:]
    for _ in range(doublings):
        F, Q = F @ F, F @ Q @ F.T + Q
    return F, 0.5 * (Q + Q.T)
