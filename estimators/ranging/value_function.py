"""What the observer of Paper C descends on, V_rho and Q of C.4, as CasADi derives them.

A robot at x = (x_1, x_2, phi) with l range sensors at angles alpha_i off its heading measures rho_i against the curve
theta. Its observer state is z = Psi(x) = (s_1, ..., s_l, phi), and

    theta(s_i) = (x_1, x_2) + rho_i R_{phi + alpha_i} e_1.                                                       (C.4)

    v_i(z) = theta(s_i) - rho_i R_{phi + alpha_i} e_1,           which is where ray i says that the robot is,
    V_rho = sum_{i < j} |v_i - v_j|^2 = |r|^2,                   r = sqrt(l) (v_i - v_mean), stacked,
    Q_i = theta'(s_i)' R_phi (u_1 e_2 + rho_dot_i R_{alpha_i} e_2 - rho_i u_2 R_{alpha_i} e_1).

z is feasible where V_rho = 0, and equivalent to the truth in output flow only where Q = 0. What the proof of
Proposition C.2 takes for granted, that V_rho + |Q|^2 / 2 is locally positive definite around the truth to second
order, is that rank [J_v; J_q] = l + 1 there, with J_v = dr / dz and J_q = dQ / dz.
"""

from __future__ import annotations

import math
from functools import lru_cache

import casadi
import numpy as np

from models.field.curve import Curve
from sim.signals import Array

_RANK = 1e-9  # of the largest singular value: what is smaller counts as nought


@lru_cache(maxsize=16)
def feasibility(curve: Curve, angles: tuple[float, ...]) -> casadi.Function:
    """(z (l + 1,), rho (l,)) -> V_rho [m^2], r (2 l,) [m], J_v (2 l, l + 1)."""
    l = len(angles)  # noqa: E741
    z, rho = casadi.SX.sym("z", l + 1), casadi.SX.sym("rho", l)
    v = [curve.symbolic(z[i]) - rho[i] * _direction(z[l] + angle) for i, angle in enumerate(angles)]
    mean = sum(v[1:], v[0]) / l
    r = math.sqrt(l) * casadi.vertcat(*(each - mean for each in v))
    V = casadi.SX(0.0)
    for i in range(l):
        for j in range(i + 1, l):
            V += casadi.sumsqr(v[i] - v[j])
    return casadi.Function("feasibility", [z, rho], [V, r, casadi.jacobian(r, z)])


@lru_cache(maxsize=16)
def output_flow(curve: Curve, angles: tuple[float, ...]) -> casadi.Function:
    """(z (l + 1,), rho (l,), rho_dot (l,), u (2,)) -> Q (l,) [m^2/s], J_q (l, l + 1)."""
    l = len(angles)  # noqa: E741
    z, rho, rho_dot = casadi.SX.sym("z", l + 1), casadi.SX.sym("rho", l), casadi.SX.sym("rho_dot", l)
    u, s = casadi.SX.sym("u", 2), casadi.SX.sym("s")
    tangent = casadi.Function("tangent", [s], [casadi.jacobian(curve.symbolic(s), s)])
    Q = []
    for i, angle in enumerate(angles):
        ahead, across = _direction(angle), _direction(angle + 0.5 * math.pi)  # R_alpha e_1, R_alpha e_2
        w = u[0] * casadi.DM([0.0, 1.0]) + rho_dot[i] * across - rho[i] * u[1] * ahead
        Q.append(tangent(z[i]).T @ _rotation(z[l]) @ w)
    stacked = casadi.vertcat(*Q)
    return casadi.Function("output_flow", [z, rho, rho_dot, u], [stacked, casadi.jacobian(stacked, z)])


def singular_values(curve: Curve, angles: tuple[float, ...], z: Array, rho: Array, rho_dot: Array, u: Array) -> Array:
    """(l + 1,) of [J_v; J_q], the largest first."""
    _, _, J_v = feasibility(curve, angles)(z, rho)
    _, J_q = output_flow(curve, angles)(z, rho, rho_dot, u)
    values: Array = np.linalg.svd(np.vstack([np.array(J_v), np.array(J_q)]), compute_uv=False)
    return values


def rank(values: Array) -> int:
    """Of the matrix with these singular values, the largest first."""
    return int(np.count_nonzero(values > _RANK * values[0]))


def _direction(angle: casadi.SX | float) -> casadi.SX:
    return casadi.vertcat(casadi.cos(angle), casadi.sin(angle))


def _rotation(angle: casadi.SX) -> casadi.SX:
    c, s = casadi.cos(angle), casadi.sin(angle)
    return casadi.vertcat(casadi.horzcat(c, -s), casadi.horzcat(s, c))
