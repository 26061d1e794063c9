"""Q of C.4 as printed, derived by CasADi: the reference for the compiled observer.

With the letters of ``observer_kernels``,

    Q_i = theta'(s_i)' R_phi (u_1 e_2 + rho_dot_i R_{alpha_i} e_2 - rho_i u_2 R_{alpha_i} e_1),

and the state z is equivalent to the truth in output flow only where Q = 0.
"""

from __future__ import annotations

import math
from functools import lru_cache

import casadi

from mathnavi.models.field.curve import Curve


@lru_cache(maxsize=16)
def output_flow(curve: Curve, angles: tuple[float, ...]) -> casadi.Function:
    """Function (z (l + 1,), rho (l,), rho_dot (l,), u (2,)) -> Q (l,) [m^2/s], J_q (l, l + 1)."""
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


def _direction(angle: casadi.SX | float) -> casadi.SX:
    return casadi.vertcat(casadi.cos(angle), casadi.sin(angle))


def _rotation(angle: casadi.SX) -> casadi.SX:
    c, s = casadi.cos(angle), casadi.sin(angle)
    return casadi.vertcat(casadi.horzcat(c, -s), casadi.horzcat(s, c))
