"""Collocation in integral form at points of an interval: Gauss-Legendre, Radau IIA and Legendre-Gauss-Lobatto.

At the k points c_1 < ... < c_k of [0, 1] the rates are f_j = f(X_j, u_j), and the state is the polynomial whose
derivative is the one through them,

    X_j = x_0 + d Σ_k A_jk f_k,     A_jk = ∫_0^{c_j} l_k,      x_1 = x_0 + d Σ_k b_k f_k,     b_k = ∫_0^1 l_k.

A point at 0 is the state x_0 and a point at 1 the state x_1; the others are additional unknowns.

**Gauss-Legendre**: the highest order for its number of points, none of them at an end of the interval. The dynamics
hold at the k zeros of Legendre's polynomial P_k on [0, 1]. At both ends the control is the polynomial's extrapolation,
and path constraints do not hold there.

**Radau IIA**: stiffly accurate, with a point at the end of an interval and none at its start. The dynamics hold at the
k zeros 0 < c_1 < ... < c_k = 1 of P_k - P_{k-1}. Controls of neighbouring intervals have no point in common, so a
control may jump at a node; at the start of an interval it is the polynomial's extrapolation. The method damps what is
stiff and does not let a singular control ring between two levels, as Lobatto's symmetric points do.

**Legendre-Gauss-Lobatto pseudospectral collocation**: the dynamics hold at the K + 1 points 0 = c_0 < ... < c_K = 1,

    X_j = x_0 + d Σ_k A_jk f(X_k, u_k),     A_jk = ∫_0^{c_j} l_k,     j = 1 ... K        (Lobatto IIIA),

the quadrature is Gauss-Lobatto's. A grid of one interval is the global method; several intervals with few points each
are the composite one. K = 1 is the trapezoid and K = 2 is Hermite-Simpson.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Annotated

import casadi as ca
import numpy as np
from annotated_types import Ge, Le
from numpy.polynomial import Legendre

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates, gauss_legendre, integral_weights
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.signals import Array


def integration_matrix(points: tuple[float, ...]) -> tuple[Array, Array]:
    """A (·, k), its rows those of the points inside ]0, 1[, and the quadrature b (k,)."""
    inside = [c for c in points if 0.0 < c < 1.0]
    every = integral_weights(points, np.array([*inside, 1.0]))
    return every[:-1], every[-1]


class Collocation(abc.ABC):
    """Base of the schemes that are collocated at their ``points``."""

    @property
    @abc.abstractmethod
    def points(self) -> tuple[float, ...]:
        """Points (k,) c_j, fractions of the interval."""

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """X_j = x_0 + d Σ_k A_jk f_k at the points, x_1 = x_0 + d Σ_k b_k f_k, at the cost d Σ_k b_k L_k."""
        points = self.points
        states = (*((x_0,) if points[0] == 0.0 else ()), *X, *((x_1,) if points[-1] == 1.0 else ()))
        pairs = [rates(x, u, t + c * d) for x, u, c in zip(states, U, points, strict=True)]
        A, b = (matrix.tolist() for matrix in integration_matrix(points))

        def integral(row: Sequence[float], values: Sequence[ca.SX]) -> ca.SX:
            return d * sum((a * value for a, value in zip(row, values, strict=True)), ca.SX(0))

        f, cost = zip(*pairs, strict=True)
        inner = [x_0 + integral(row, f) - x for row, x in zip(A, X, strict=True)]
        return IntervalEquations(
            flow=x_0 + integral(b, f),
            inner=ca.vertcat(*inner) if inner else ca.SX(0, 1),
            cost=integral(b, cost),
            states=states,
        )


@configuration
class GaussLegendre(Collocation):
    """Gauss-Legendre collocation at ``count`` points k of every interval; order 2 k.

    FieldError for a number of points outside 2 to 30.
    """

    count: Annotated[int, Ge(2), Le(30)] = 3
    shared: bool = False
    explicit: bool = False
    costate_at: float = 0.0

    @property
    def name(self) -> str:
        """Name of the scheme, with its order."""
        return f"Gauss-Legendre of order {self.order}"

    @property
    def order(self) -> int:
        """Order 2 k of a state at the end of an interval."""
        return 2 * self.count

    @property
    def interior(self) -> int:
        """Number k of unknown states inside an interval."""
        return self.count

    @cached_property
    def points(self) -> tuple[float, ...]:
        """Gauss points (k,) c_j, fractions of the interval."""
        return tuple((0.5 * (1.0 + gauss_legendre(self.count)[0])).tolist())


@configuration
class RadauIIA(Collocation):
    """Radau IIA collocation at ``count`` points k of every interval; order 2 k - 1.

    FieldError for a number of points outside 2 to 30.
    """

    count: Annotated[int, Ge(2), Le(30)] = 3
    shared: bool = False
    explicit: bool = False
    costate_at: float = 0.0

    @property
    def name(self) -> str:
        """Name of the scheme, with its order."""
        return f"Radau IIA of order {self.order}"

    @property
    def order(self) -> int:
        """Order 2 k - 1 of a state at the end of an interval."""
        return 2 * self.count - 1

    @property
    def interior(self) -> int:
        """Number k - 1 of unknown states inside an interval."""
        return self.count - 1

    @cached_property
    def points(self) -> tuple[float, ...]:
        """Radau points (k,) c_j, fractions of the interval."""
        return radau(self.count)


@lru_cache(maxsize=64)
def radau(count: int) -> tuple[float, ...]:
    """Radau points (k,): the zeros of P_k - P_{k-1} on [0, 1], the last of them 1, k = ``count``."""
    zeros = np.sort(np.real((Legendre.basis(count) - Legendre.basis(count - 1)).roots()))
    return (*(0.5 * (1.0 + zeros[:-1])).tolist(), 1.0)


@configuration
class LegendreGaussLobatto(Collocation):
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


@lru_cache(maxsize=64)
def legendre_gauss_lobatto(degree: int) -> tuple[float, ...]:
    """Legendre-Gauss-Lobatto points (K + 1,): the ends of [0, 1] and the zeros of P_K' between them, K = ``degree``."""
    inner = Legendre.basis(degree).deriv().roots() if degree > 1 else np.empty(0)
    return (0.0, *(0.5 * (1.0 + np.sort(np.real(inner)))).tolist(), 1.0)
