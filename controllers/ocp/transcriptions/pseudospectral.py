"""Legendre-Gauss-Lobatto pseudospectral collocation.

In each interval the dynamics hold at the K + 1 Legendre-Gauss-Lobatto points 0 = c_0 < ... < c_K = 1, in integral form

    X_j = x_0 + d Σ_k A_jk f(X_k, u_k),     A_jk = ∫_0^{c_j} l_k,     j = 1 ... K        (Lobatto IIIA),

the quadrature is Gauss-Lobatto's. A grid of one interval is the global method; several intervals with few points each
are the composite one. K = 1 is the trapezoid and K = 2 is Hermite-Simpson.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Annotated

import casadi as ca
import numpy as np
from annotated_types import Ge, Le
from numpy.polynomial import Legendre

from mathnavi.controllers.ocp.transcriptions.collocation import collocated
from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates
from mathnavi.interfaces.bounds import configuration


@configuration
class LegendreGaussLobatto:
    """Legendre-Gauss-Lobatto collocation: the rates a polynomial of ``degree`` K on every interval; order 2 K.

    FieldError for a degree outside 1 to 60.
    """

    degree: Annotated[int, Ge(1), Le(60)] = 4
    shared: bool = True
    explicit: bool = False

    @property
    def name(self) -> str:
        """Name of the scheme, with its degree."""
        return f"Legendre-Gauss-Lobatto of degree {self.degree}"

    @property
    def order(self) -> int:
        """Order 2 K of a state at the end of an interval."""
        return 2 * self.degree

    @property
    def interior(self) -> int:
        """Number K - 1 of unknown states inside an interval."""
        return self.degree - 1

    @property
    def costate_at(self) -> float:
        """First weight of the quadrature, 1 / (K (K + 1)), as a fraction of the interval."""
        return 1.0 / (self.degree * (self.degree + 1))

    @cached_property
    def points(self) -> tuple[float, ...]:
        """Legendre-Gauss-Lobatto points (K + 1,) c_j, fractions of the interval."""
        return legendre_gauss_lobatto(self.degree)

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """X_j = x_0 + d Σ_k A_jk f_k at the inner points and at the end, at the cost d Σ_k A_Kk L_k."""
        return collocated(self.points, rates, x_0, X, x_1, U, t, d)


@lru_cache(maxsize=64)
def legendre_gauss_lobatto(degree: int) -> tuple[float, ...]:
    """Legendre-Gauss-Lobatto points (K + 1,): the ends of [0, 1] and the zeros of P_K' between them, K = ``degree``."""
    inner = Legendre.basis(degree).deriv().roots() if degree > 1 else np.empty(0)
    return (0.0, *(0.5 * (1.0 + np.sort(np.real(inner)))).tolist(), 1.0)
