"""The cart-pole swing-up with the least force squared (Kelly, SIAM Review 59, 2017).

    minimise ∫_0^2 F^2 dt   subject to   |F| <= 20,   (q, φ, q', φ') = (0, 0, 0, 0) to (1, π, 0, 0)
    (M + m) q'' + m L (φ'' cos φ - φ'^2 sin φ) = F,        L φ'' + q'' cos φ + g sin φ = 0

with cart M = 1 kg, pole m = 0.3 kg, L = 0.5 m, g = 9.81 m/s^2; φ = 0 hangs. J* = 58.807667.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

CART, POLE, LENGTH, GRAVITY = 1.0, 0.3, 0.5, 9.81  # [kg], [kg], [m], [m/s^2]


@cache
def cart_pole() -> ProblemFunctions:
    """Swing-up from hanging to standing, one metre on, in 2 s."""
    M, m, L, g = CART, POLE, LENGTH, GRAVITY
    ocp = OptimalControlProblem("cart-pole")

    q = ocp.state("q", guess=(0.0, 1.0))  # [m]
    phi = ocp.state("phi", scale=math.pi, guess=(0.0, math.pi))  # [rad]
    dq = ocp.state("dq", scale=2.0)  # [m/s]
    dphi = ocp.state("dphi", scale=5.0)  # [rad/s]
    F = ocp.control("F", lower=-20.0, upper=20.0, scale=10.0)  # [N]
    ocp.duration(2.0)

    ocp.minimise(running=F**2)

    sin, cos = ca.sin(phi), ca.cos(phi)
    inertia = M + m * sin**2
    ocp.dynamics(q, dq)
    ocp.dynamics(phi, dphi)
    ocp.dynamics(dq, (F + m * sin * (L * dphi**2 + g * cos)) / inertia)
    ocp.dynamics(dphi, -(F * cos + m * L * dphi**2 * sin * cos + (M + m) * g * sin) / (L * inertia))

    for state in (q, phi, dq, dphi):
        ocp.start(state, 0.0)
    for state, value in ((q, 1.0), (phi, math.pi), (dq, 0.0), (dphi, 0.0)):
        ocp.end(state, value)
    return ocp.functions()
