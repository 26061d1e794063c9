"""Collocation in integral form, at any points of an interval: the part common to all families of points.

At the k points c_1 < ... < c_k of [0, 1] the rates are f_j = f(X_j, u_j), and the state is the polynomial whose
derivative is the one through them,

    X_j = x_0 + d Σ_k A_jk f_k,     A_jk = ∫_0^{c_j} l_k,      x_1 = x_0 + d Σ_k b_k f_k,     b_k = ∫_0^1 l_k.

A point at 0 is the state x_0 and a point at 1 the state x_1; the others are additional unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates, integral_weights
from mathnavi.interfaces.signals import Array


def integration_matrix(points: tuple[float, ...]) -> tuple[Array, Array]:
    """A (·, k), its rows those of the points inside ]0, 1[, and the quadrature b (k,)."""
    inside = [c for c in points if 0.0 < c < 1.0]
    every = integral_weights(points, np.array([*inside, 1.0]))
    return every[:-1], every[-1]


def collocated(
    points: tuple[float, ...],
    rates: Rates,
    x_0: ca.SX,
    X: Sequence[ca.SX],
    x_1: ca.SX,
    U: Sequence[ca.SX],
    t: ca.SX,
    d: ca.SX,
) -> IntervalEquations:
    """Equations of an interval that is collocated at ``points`` (k,); the other arguments are those of a scheme."""
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
