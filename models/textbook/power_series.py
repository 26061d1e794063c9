"""The diffeomorphism of Kazantzis and Kravaris (thesis 2.4) as a power series.

Without an input and with F(0) = 0, h(0) = 0, the T with T(0) = 0 that takes x' = F(x), y = h(x) to x~' = A x~ - g(y)
solves

    dT/dx F(x) = A T(x) - g(h(x)).

Here A = diag(p_1 .. p_n), and g(y) = -y (1 .. 1)'. With T_i = sum t_k x^k over the multi-indices k, 1 <= |k| <= N, and
F_j and h expanded in the same way to F_j,m x^m and h_m x^m, the coefficients of x^m are

    sum_j sum_k k_j F_j,(m - k + e_j) t_k - p_i t_m = h_m,

a linear system for each i. It has one solution where no p_i is a sum of eigenvalues of dF/dx(0) (Lyapunov's auxiliary
theorem), and the series converges near the origin where these lie on one side of the imaginary axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from math import factorial, prod

import casadi
import numpy as np

from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.textbook.system import System, check_poles

_SINGULAR = 1e12  # condition number


@dataclass(frozen=True, eq=False)
class PowerSeries:
    """T_i(x) = sum over k of coefficients[i, k] x^exponents[k]."""

    exponents: Integers  # (K, n)
    coefficients: Array  # (n, K)

    def __call__(self, x: casadi.SX) -> casadi.SX:
        """T(x) (n,)."""
        powers = [[casadi.SX(1.0)] for _ in range(x.numel())]
        for j, own in enumerate(powers):
            for _ in range(int(self.exponents.max())):
                own.append(own[-1] * x[j])
        monomials = casadi.vertcat(*(prod(powers[j][e] for j, e in enumerate(k)) for k in self.exponents.tolist()))
        value: casadi.SX = casadi.DM(self.coefficients) @ monomials
        return value


def solved(system: System, poles: Sequence[float], order: int) -> PowerSeries:
    """Solve for T to the order N with A = diag(poles).

    Raises ArgumentError for a system with inputs or without rest at the origin, FieldError for poles that are not n
    different numbers < 0 or are sums of eigenvalues of the linearisation.
    """
    n = len(system.states)
    if system.inputs or len(system.outputs) != 1:
        raise ArgumentError(f"system = {system.name!r}; allowed: one without inputs and with a single output")
    check_poles(poles, n)
    if not 1 <= order <= 15:
        raise FieldError(f"order = {order!r}; allowed: 1 to 15")
    nothing = casadi.SX.zeros(0)
    F = _taylor(lambda x: system.f(x, nothing), n, n, order)
    h = _taylor(lambda x: system.h(x, nothing), n, 1, order)
    origin = (0,) * n
    if F[origin].any() or h[origin].any():
        raise ArgumentError(f"system = {system.name!r}; allowed: one that is at rest with y = 0 at the origin")
    indices = [k for k in _multi_indices(n, order) if any(k)]
    carried = np.zeros((len(indices), len(indices)))
    for (row, m), (column, k) in product(enumerate(indices), enumerate(indices)):
        for j in range(n):
            rest = tuple(m[i] - k[i] + (i == j) for i in range(n))
            if k[j] and min(rest) >= 0 and rest in F:
                carried[row, column] += k[j] * F[rest][j]
    right = np.array([h[m][0] for m in indices])
    coefficients = []
    for pole in poles:
        matrix = carried - pole * np.eye(len(indices))
        if np.linalg.cond(matrix) > _SINGULAR:
            raise FieldError(f"poles: {pole!r} is a sum of eigenvalues of the linearisation; allowed: one that is not")
        coefficients.append(np.linalg.solve(matrix, right))
    return PowerSeries(np.array(indices, dtype=np.int64), np.array(coefficients))


def _multi_indices(n: int, order: int) -> list[tuple[int, ...]]:
    """Multi-indices of n numbers >= 0 with a sum up to ``order``, sorted by their sum."""
    every = [k for k in product(range(order + 1), repeat=n) if sum(k) <= order]
    return sorted(every, key=lambda k: (sum(k), k))


def _taylor(function: Callable[[casadi.SX], casadi.SX], n: int, size: int, order: int) -> dict[tuple[int, ...], Array]:
    """Taylor coefficients (size,) at the origin by multi-index."""
    x = casadi.SX.sym("x", n)
    derivatives = {(0,) * n: function(x)}
    for k in _multi_indices(n, order)[1:]:
        j = next(i for i in range(n) if k[i])
        below = tuple(k[i] - (i == j) for i in range(n))
        derivatives[k] = casadi.jacobian(derivatives[below], x[j])
    at_origin = casadi.Function("derivatives", [x], list(derivatives.values()))(np.zeros(n))
    return {
        k: np.array(value).reshape(size) / prod(map(factorial, k))
        for k, value in zip(derivatives, at_origin, strict=True)
    }
