"""Weights of sampled observers of a double and a triple integrator, by placement of the poles of their error.

With L = y - x^- at a reading, h after the one before, x = x^- + alpha L and v = v^- + beta L have the error dynamics

    (e_x, e_v) -> [[1 - alpha, (1 - alpha) h], [-beta, 1 - beta h]] (e_x, e_v),

whose poles are rho_i = e^(lambda_i h), lambda^2 + 2 zeta omega lambda + omega^2 = 0, for

    alpha = 1 - rho_1 rho_2,    beta = (1 - rho_1)(1 - rho_2) / h.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Array


def pole_weights(omega: float, zeta: float, h: float) -> tuple[float, float]:
    """Weights alpha and beta [1/s], without cancellation for short h [s] and without overflow for long h."""
    alpha = -math.expm1(-2.0 * zeta * omega * h)
    if zeta >= 1.0:
        slow = omega / (zeta + math.sqrt(zeta * zeta - 1.0))
        return alpha, math.expm1(-slow * h) * math.expm1(-(omega * omega / slow) * h) / h
    decay, damped = zeta * omega, omega * math.sqrt(1.0 - zeta * zeta)
    versine = 2.0 * math.sin(0.5 * damped * h) ** 2  # 1 - cos(damped h)
    return alpha, (math.expm1(-decay * h) ** 2 + 2.0 * math.exp(-decay * h) * versine) / h


def triple_pole_weights(omega: float | Array, h: float) -> tuple[Array, Array, Array]:
    """Weights alpha, beta [1/s] and gamma [1/s^2] of an observer of a triple integrator: three poles at rho = e^(-omega
    h).
    """
    rho, left = np.exp(-omega * h), -np.expm1(-omega * h)
    return 1.0 - rho**3, 1.5 * left**2 * (1.0 + rho) / h, left**3 / h**2
