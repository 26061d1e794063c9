"""A robot arm turned in the least time: a bar that slides and swings on two axes (Moessner-Beigel 1999; COPS 3).

    minimise T   subject to   ρ'' = u1 / L,   θ'' = u2 / I_θ,   φ'' = u3 / I_φ,   |u| <= 1,
        I_φ = ((L - ρ)^3 + ρ^3) / 3,   I_θ = I_φ sin^2 φ,   L = 5,   (4.5, 0, π/4) to (4.5, 2π/3, π/4), rest to rest

All three controls are bang-bang: T* = 9.1409117. 9.140936 and 9.140963 are often seen, of grids too coarse.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

LENGTH, TURN = 5.0, 2.0 * math.pi / 3.0


@cache
def robot_arm() -> ProblemFunctions:
    """Fastest turn by 120 degrees."""
    L = LENGTH
    ocp = OptimalControlProblem("robot arm")

    rho = ocp.state("rho", lower=0.0, upper=L, guess=(4.5, 4.5))
    theta = ocp.state("theta", lower=-math.pi, upper=math.pi, guess=(0.0, TURN))  # [rad]
    phi = ocp.state("phi", lower=0.0, upper=math.pi, guess=(math.pi / 4, math.pi / 4))  # [rad]
    drho = ocp.state("drho")
    dtheta = ocp.state("dtheta")
    dphi = ocp.state("dphi")
    u1, u2, u3 = (ocp.control(f"u{k}", lower=-1.0, upper=1.0) for k in (1, 2, 3))
    T = ocp.free_duration(guess=9.0, lower=0.1, upper=100.0)

    ocp.minimise(terminal=T)

    I_phi = ((L - rho) ** 3 + rho**3) / 3
    ocp.dynamics(rho, drho)
    ocp.dynamics(theta, dtheta)
    ocp.dynamics(phi, dphi)
    ocp.dynamics(drho, u1 / L)
    ocp.dynamics(dtheta, u2 / (I_phi * ca.sin(phi) ** 2))
    ocp.dynamics(dphi, u3 / I_phi)

    for state, start, end in ((rho, 4.5, 4.5), (theta, 0.0, TURN), (phi, math.pi / 4, math.pi / 4)):
        ocp.start(state, start)
        ocp.end(state, end)
    for state in (drho, dtheta, dphi):
        ocp.start(state, 0.0)
        ocp.end(state, 0.0)
    return ocp.functions()
