"""Terminal bunt manoeuvre: a missile flies low, climbs and dives onto its target (Subchan and Zbikowski, 2009; PSOPT).

    minimise T   subject to   x' = V cos γ,   h' = V sin γ,
        γ' = ((F - D) sin α + L cos α) / (m V) - g cos γ / V,      V' = ((F - D) cos α - L sin α) / m - g sin γ,
        D = q (A1 α^2 + A2 α + A3),   L = q B1 α,   q = ρ V^2 S / 2,   ρ = C1 h^2 + C2 h + C3,
        1000 <= F <= 6000 N,   |α| <= 0.3,   200 <= V <= 310 m/s,   |L| <= 4 m g,
        H (h - 30) + (1 - H) h >= 0,   H = (1 + tanh((7500 - x) / 10)) / 2,
        (γ, V, x, h) = (0, 272, 0, 30) to (-π/2, 310, 10000, 0)

It flies on the least height of 30 m until it has to climb, at full thrust. T* = 40.911939 s.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

MASS, GRAVITY, AREA = 1005.0, 9.81, 0.3376  # [kg], [m/s^2], [m^2]
A1, A2, A3, B1 = -1.9431, -0.1499, 0.2359, 21.9
C1, C2, C3 = 3.312e-9, -1.142e-4, 1.224
MOST_LOAD = 4.0  # [g]


@cache
def bunt() -> ProblemFunctions:
    """Fastest flight over 10 km that ends in a vertical dive."""
    m, g = MASS, GRAVITY
    ocp = OptimalControlProblem("bunt")

    gamma = ocp.state("gamma", lower=-math.pi / 2, upper=math.pi / 2, guess=(0.0, -math.pi / 2))  # [rad]
    V = ocp.state("V", lower=200.0, upper=310.0, scale=300.0, guess=(272.0, 310.0))  # [m/s]
    x = ocp.state("x", lower=0.0, upper=10000.0, scale=1e4, guess=(0.0, 10000.0))  # [m]
    h = ocp.state("h", lower=0.0, upper=1900.0, scale=1e3, guess=(30.0, 0.0))  # [m]
    F = ocp.control("F", lower=1000.0, upper=6000.0, scale=5e3, guess=(6000.0, 6000.0))  # [N]
    alpha = ocp.control("alpha", lower=-0.3, upper=0.3, scale=0.1)  # [rad]
    T = ocp.free_duration(guess=50.0, lower=10.0, upper=100.0)

    ocp.minimise(terminal=T)

    q = (C1 * h**2 + C2 * h + C3) * V**2 * AREA / 2
    D, L = q * (A1 * alpha**2 + A2 * alpha + A3), q * B1 * alpha
    sin, cos = ca.sin(alpha), ca.cos(alpha)
    ocp.dynamics(gamma, ((F - D) * sin + L * cos) / (m * V) - g * ca.cos(gamma) / V)
    ocp.dynamics(V, ((F - D) * cos - L * sin) / m - g * ca.sin(gamma))
    ocp.dynamics(x, V * ca.cos(gamma))
    ocp.dynamics(h, V * ca.sin(gamma))

    H = (1 + ca.tanh((7500 - x) / 10)) / 2
    ocp.constrain(L / (m * g), lower=-MOST_LOAD, upper=MOST_LOAD)
    ocp.constrain((H * (h - 30) + (1 - H) * h) / 1000, lower=0.0)

    for state, start, end in ((gamma, 0.0, -math.pi / 2), (V, 272.0, 310.0), (x, 0.0, 10000.0), (h, 30.0, 0.0)):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()
