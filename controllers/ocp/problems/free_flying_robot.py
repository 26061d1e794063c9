"""A robot that floats and has two pairs of thrusters, brought to rest with the least fuel (Sakawa 1999; Betts, SOS).

    minimise ∫_0^12 u1 + u2 + u3 + u4 dt   subject to
        x'' = (F1 + F2) cos θ,   y'' = (F1 + F2) sin θ,   θ'' = 0.2 F1 - 0.2 F2,   F1 = u1 - u2,   F2 = u3 - u4,
        u >= 0,   u1 + u2 <= 1,   u3 + u4 <= 1,   (-10, -10, π/2) at rest to 0 at rest

Thrusters are on or off, with eight switchings: J* = 7.9101471. 7.910155 is often seen, of a grid too coarse.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

ARM = 0.2


@cache
def free_flying_robot() -> ProblemFunctions:
    """Flight from rest to rest in 12 s, with the least fuel."""
    ocp = OptimalControlProblem("free-flying robot")

    x = ocp.state("x", scale=10.0, guess=(-10.0, 0.0))
    y = ocp.state("y", scale=10.0, guess=(-10.0, 0.0))
    theta = ocp.state("theta", guess=(math.pi / 2, 0.0))
    dx = ocp.state("dx")
    dy = ocp.state("dy")
    omega = ocp.state("omega", scale=0.3)
    u1, u2, u3, u4 = (ocp.control(f"u{k}", lower=0.0, guess=(0.2, 0.2)) for k in range(1, 5))
    ocp.duration(12.0)

    ocp.minimise(running=u1 + u2 + u3 + u4)

    F1, F2 = u1 - u2, u3 - u4
    ocp.dynamics(x, dx)
    ocp.dynamics(y, dy)
    ocp.dynamics(theta, omega)
    ocp.dynamics(dx, (F1 + F2) * ca.cos(theta))
    ocp.dynamics(dy, (F1 + F2) * ca.sin(theta))
    ocp.dynamics(omega, ARM * (F1 - F2))

    ocp.constrain(u1 + u2, upper=1.0)
    ocp.constrain(u3 + u4, upper=1.0)

    for state, value in ((x, -10.0), (y, -10.0), (theta, math.pi / 2), (dx, 0.0), (dy, 0.0), (omega, 0.0)):
        ocp.start(state, value)
        ocp.end(state, 0.0)
    return ocp.functions()
