"""Known functions of time within a problem: Legendre series in τ = t / T whose coefficients are parameters.

    f(τ) = Σ_n c_n P_n(2 τ - 1),      (n + 1) P_(n+1)(s) = (2 n + 1) s P_n(s) - n P_(n-1)(s),

fitted by least squares to what another problem found at its nodes or held between them.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from mathnavi.controllers.ocp.statement import Statement
from mathnavi.sim.interfaces.signals import Array

DEGREE = 8


def declare(ocp: Statement, name: str) -> list[ca.SX]:
    """Parameters of a problem for the coefficients of one function."""
    return [ocp.parameter(f"{name}_{n}", 0.0) for n in range(DEGREE + 1)]


def series(c: Sequence[ca.SX], tau: ca.SX) -> ca.SX:
    """f(τ)."""
    s = 2 * tau - 1
    before, basis = ca.SX(1), s
    total = c[0] + c[1] * s
    for n in range(1, DEGREE):
        before, basis = basis, ((2 * n + 1) * s * basis - n * before) / (n + 1)
        total += c[n + 1] * basis
    return total


def fitted(tau: Array, values: Sequence[Array]) -> Array:
    """Coefficients, one function after the other, of functions with the values (n,) given at fractions tau (n,)."""
    basis = legendre.legvander(2.0 * tau - 1.0, DEGREE)
    coefficients, *_ = np.linalg.lstsq(basis, np.column_stack(values), rcond=None)
    return np.asarray(coefficients.T.ravel())
