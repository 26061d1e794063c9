"""Transcriptions: the equations that join states, controls and dynamics over one interval (thesis 1.1.2, B.2).

Over [t, t + d] the unknowns are the states at both ends, x_0 and x_1, the controls U at ``points`` (fractions of the
interval), and the states X at ``interior`` of those points: the ones between the ends, where a scheme does not express
them by the others. No scheme needs a point at either end: a control is extrapolated to an end that is no point. The
scheme turns the unknowns into equations that vanish and into its quadrature of the running cost. The control in between
is Lagrange's polynomial through its points; the state is

    x(t + c d) = x_0 + d Σ_j f_j ∫_0^c l_j,          f_j = f(x_j, u_j) at the points, l_j Lagrange's basis,

whose derivative is the polynomial through the f_j: the collocation polynomial. A scheme may bring a better one.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import casadi as ca
import numpy as np

from mathnavi.interfaces.signals import Array

Rates = Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]
"""(x (nx,), u (nu,), t () [s]) -> (x' = f(x, u, t) (nx,), running cost L(x, u, t) ())"""


@dataclass(frozen=True, eq=False)
class IntervalEquations:
    """The equations of one interval, symbolic: x_1 = flow, 0 = inner."""

    flow: ca.SX  # (nx,) equals x_1 in a solution; of an explicit scheme it does not depend on x_1
    inner: ca.SX  # (interior * nx,) vanishes in a solution
    cost: ca.SX  # () its share of ∫ L dt
    states: tuple[ca.SX, ...]  # (nx,) each: the state at each of the scheme's points
    between: tuple[tuple[float, ca.SX], ...] = ()
    """fractions of the interval, and states (nx,) there, at which path constraints hold too, under the first control"""


class Scheme(Hashable, Protocol):
    """A transcription: its points, its order and the equations of an interval."""

    @property
    def name(self) -> str:
        """Name of the scheme."""
        ...

    @property
    def order(self) -> int:
        """Order: the error of a state after one interval of width d is O(d^(order + 1))."""
        ...

    @property
    def points(self) -> tuple[float, ...]:
        """Fractions (k,) of the interval, in [0, 1], at which the control is an unknown."""
        ...

    @property
    def shared(self) -> bool:
        """True if the control at the end of an interval is the one at the start of the next: continuous control."""
        ...

    @property
    def interior(self) -> int:
        """Number of unknown states inside an interval."""
        ...

    @property
    def explicit(self) -> bool:
        """True if x_1 follows from x_0 and U without solving for it."""
        ...

    @property
    def costate_at(self) -> float:
        """Fraction of the interval at which the multipliers of its equations are the costate."""
        ...

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """Equations over [t, t + d].

        Args:
            rates: dynamics and running cost.
            x_0: (nx,) state at t.
            X: states (nx,) at the ``interior`` points.
            x_1: (nx,) state at t + d.
            U: controls (nu,) at each of the ``points``.
            t: () [s] start of the interval.
            d: () [s] width of the interval.

        Returns:
            The equations that a solution fulfils, with the interval's share of ∫ L dt.
        """
        ...


def weights(points: tuple[float, ...], at: Array) -> Array:
    """Interpolation weights (n, k): w_ij = l_j(at_i), of values at the points (k,) in the value at fractions (n,)."""
    return _basis(points, at)


def integral_weights(points: tuple[float, ...], to: Array) -> Array:
    """Integration weights (n, k): w_ij = ∫_0^to_i l_j, of rates at the points (k,) in the integral to fractions (n,).

    Gauss-Legendre quadrature, exact for these polynomials.
    """
    nodes, share = gauss_legendre(len(points) // 2 + 1)
    basis = _basis(points, (0.5 * to[:, None] * (nodes + 1.0)).ravel()).reshape(len(to), len(nodes), len(points))
    integrals: Array = 0.5 * to[:, None] * np.einsum("g,ngk->nk", share, basis)
    return integrals


@lru_cache(maxsize=64)
def gauss_legendre(count: int) -> tuple[Array, Array]:
    """Zeros (k,) of Legendre's polynomial P_k on [-1, 1], k = ``count``, and the weights (k,) of their quadrature."""
    return np.polynomial.legendre.leggauss(count)


def _basis(points: tuple[float, ...], at: Array) -> Array:
    """(n, k) Lagrange's basis at n places, by the barycentric formula: stable for sixty points."""
    c = np.array(points)
    # Products of many differences in [0, 1] underflow; only their ratios matter, so each counts four times.
    barycentric = 1.0 / np.prod(4.0 * (c[:, None] - c[None, :]) + np.eye(len(c)), axis=1)
    difference = at[:, None] - c
    hit = np.abs(difference) < 1e-15
    exact = hit.any(axis=1)[:, None]
    terms = barycentric / np.where(exact, 1.0, difference)
    values: Array = np.where(exact, hit, terms / np.where(exact, 1.0, terms.sum(axis=1, keepdims=True)))
    return values
