"""Covariance of the error of an observer that has none of its own, z' = F^(z, u, y), x^ = Phi(z) (Definition 2.1).

To first order about the estimate, with z tracking Psi(x), J = dPsi/dx, and readings with errors n of variance r that
are held for a period h,

    e_z^+ = e^{A h} e_z + Gamma n,   A = dF^/dz,   Gamma = int_0^h e^{A s} ds dF^/dy,      P_x = J^-1 P_z J^-T,

and while readings are missing, when x^ is a copy of the system, e_x^+ = (dx^+/dx) e_x. It begins with the deviations of
the assumed start. The model is taken to be right.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
from scipy.linalg import expm

from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import NumericFunction
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.slopes import output_and_slope, transition_slope
from mathnavi.models.textbook.system import System

_LEAST_NOISE = 1e-4  # [unit of the output] by which readings that are declared exact, and the sampling, are off
_SMALLEST, _LARGEST = 1e-18, 1e18  # variances
_STEP = 1e-6  # relative, of differences
_SHORT, _TERMS = 0.3, 9  # norm of a matrix whose exponential is a series of so many terms, to 1e-10

Rate = Callable[[casadi.SX, casadi.SX, casadi.SX], casadi.SX]


class ErrorCovariance:
    """Covariance P_z of the error of z, and that of x^."""

    def __init__(self, rate: Rate, size: int, Psi: Callable[[Array], Array] | None, mission: TextbookMission) -> None:
        """``rate`` is F^ (z (size,), u (p,), y (m,)), ``Psi`` takes x (n,) to z; None of an identity observer."""
        self._Psi, self._system = Psi, mission.system
        self._slopes = _slopes(rate, size, mission.system)
        self.variance = max(mission.noise, _LEAST_NOISE) ** 2
        """variance of a reading of each output"""
        J = self._slope(mission.start_state)
        self._P: Array = J @ np.diag(np.square(mission.deviation)) @ J.T

    def observe(self, z: Array, u: Array, y: Array, h: float) -> None:
        """Let the observer follow readings near y (m,) from z (size,) over h [s], with u (p,) held."""
        A, B = self._slopes(z, u, y)
        n, m = B.shape
        M = np.zeros((n + m, n + m))
        M[:n, :n], M[:n, n:] = h * A, h * B
        moved = _exponential(M)
        Phi, Gamma = moved[:n, :n], moved[:n, n:]
        self._P = _bounded(Phi @ self._P @ Phi.T + self.variance * Gamma @ Gamma.T, self._P)

    def copy(self, before: Array, after: Array, u: Array, h: float) -> None:
        """Let x^ go from ``before`` (n,) to ``after`` (n,) in h [s] as the system does, with u (p,) held."""
        try:
            moved = self._slope(after) @ transition_slope(self._system)(before, u, h)[0]
            F = moved @ np.linalg.inv(self._slope(before))
        except np.linalg.LinAlgError:
            return
        self._P = _bounded(F @ self._P @ F.T, self._P)

    def of_state(self, x: Array) -> Array:
        """Covariance (n, n) of the error of the estimate x (n,)."""
        try:
            inverse = np.linalg.inv(self._slope(x))
        except np.linalg.LinAlgError:
            return _LARGEST * np.eye(len(x))
        return _bounded(inverse @ self._P @ inverse.T, _LARGEST * np.eye(len(x)))

    def output_covariance(self, x: Array, P: Array, u: Array) -> Array:
        """Covariance (m, m) of a reading about the output of an estimate x (n,) with covariance P (n, n)."""
        C = output_and_slope(self._system)(x, u)[1]
        found: Array = C @ P @ C.T + self.variance * np.eye(len(C))
        return found

    def _slope(self, x: Array) -> Array:
        """Derivative J (size, n) of Psi at x (n,), by central differences."""
        if self._Psi is None:
            return np.eye(len(x))
        steps = _STEP * (1.0 + np.abs(x))
        columns = [(self._Psi(x + d) - self._Psi(x - d)) / (2.0 * d[k]) for k, d in enumerate(np.diag(steps))]
        return np.column_stack(columns)


def _exponential(M: Array) -> Array:
    """exp(M), by its series where that needs few terms."""
    if float(np.abs(M).max()) * len(M) > _SHORT:
        found: Array = expm(M)
        return found
    term = np.eye(len(M))
    total = term.copy()
    for k in range(1, _TERMS):
        term = term @ M / k
        total += term
    return total


def _bounded(P: Array, otherwise: Array) -> Array:
    """P, symmetric, positive definite and no larger than any error is; ``otherwise`` if it is not finite."""
    if not np.isfinite(P).all():
        return otherwise
    bounded: Array = 0.5 * (P + P.T) * min(1.0, _LARGEST / max(float(np.trace(P)), _SMALLEST))
    return bounded + _SMALLEST * np.eye(len(P))


def _slopes(rate: Rate, size: int, system: System) -> NumericFunction:
    """Function (z, u, y) -> dF^/dz (size, size) and dF^/dy (size, m)."""
    sizes = size, len(system.inputs), len(system.outputs)
    z, u, y = (casadi.SX.sym(name, n) for name, n in zip("zuy", sizes, strict=True))
    F = rate(z, u, y)
    return NumericFunction(casadi.Function("slopes", [z, u, y], [casadi.jacobian(F, z), casadi.jacobian(F, y)]))
