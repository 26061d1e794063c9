"""A robot arm of two links, moved in the least time (Luus, Iterative Dynamic Programming, 2000; PROPT and PSOPT).

    minimise T   subject to   θ' = ω2 - ω1,   φ' = ω1,   |u| <= 1,
        ω1' = (sin θ (9/4 cos θ ω1^2 + 2 ω2^2) + 4/3 (u1 - u2) - 3/2 cos θ u2) / d,
        ω2' = -(sin θ (7/2 ω1^2 + 9/4 cos θ ω2^2) - 7/3 u2 + 3/2 cos θ (u1 - u2)) / d,   d = 31/36 + 9/4 sin^2 θ,
        (ω1, ω2, θ, φ) = (0, 0, 0.5, 0) to (0, 0, 0.5, 0.522)

Both torques are bang-bang: T* = 2.9822799.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def two_link_arm() -> ProblemFunctions:
    """Fastest move of a two-link arm from rest to rest."""
    ocp = OptimalControlProblem("two-link arm")

    w1 = ocp.state("w1", lower=-2.0, upper=2.0)
    w2 = ocp.state("w2", lower=-2.0, upper=2.0)
    theta = ocp.state("theta", lower=-2.0, upper=2.0, guess=(0.5, 0.5))  # [rad]
    phi = ocp.state("phi", lower=-2.0, upper=2.0, guess=(0.522, 0.522))  # [rad]
    u1 = ocp.control("u1", lower=-1.0, upper=1.0)
    u2 = ocp.control("u2", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=3.0, lower=1.0, upper=10.0)

    ocp.minimise(terminal=T)

    sin, cos = ca.sin(theta), ca.cos(theta)
    inertia = 31 / 36 + 9 / 4 * sin**2
    ocp.dynamics(w1, (sin * (9 / 4 * cos * w1**2 + 2 * w2**2) + 4 / 3 * (u1 - u2) - 3 / 2 * cos * u2) / inertia)
    ocp.dynamics(w2, -(sin * (7 / 2 * w1**2 + 9 / 4 * cos * w2**2) - 7 / 3 * u2 + 3 / 2 * cos * (u1 - u2)) / inertia)
    ocp.dynamics(theta, w2 - w1)
    ocp.dynamics(phi, w1)

    for state, start, end in ((w1, 0.0, 0.0), (w2, 0.0, 0.0), (theta, 0.5, 0.5), (phi, 0.0, 0.522)):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()
