"""Orbit raising: the largest circle that a small constant thrust reaches in a given time (Bryson and Ho, 2.5).

    maximise r(T)   subject to   r' = w,   w' = v^2 / r - 1 / r^2 + F sin φ / m(t),   v' = -w v / r + F cos φ / m(t),
                                 m(t) = 1 - 0.0749 t,   F = 0.1405,   T = 3.32,   (1, 0, 1) to w = 0, v = 1 / √r

in units of the first orbit's radius and speed: w the radial, v the tangential speed, φ the thrust's angle above the
local horizon. The thrust points outwards for half of the time and inwards for the other, and swings over quickly in
between: r(T)* = 1.5252777.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

THRUST, FUEL_FLOW, DURATION = 0.1405, 0.0749, 3.32


@cache
def orbit_raising() -> ProblemFunctions:
    """Raise a circular orbit as far as possible in 3.32 time units: Earth's to Mars', in 193 days."""
    ocp = OptimalControlProblem("orbit raising")

    r = ocp.state("r", lower=0.5, upper=5.0, guess=(1.0, 1.5))
    w = ocp.state("w", lower=-10.0, upper=10.0, guess=(0.0, 0.0))
    v = ocp.state("v", lower=-10.0, upper=10.0, guess=(1.0, 0.8))
    phi = ocp.control("phi", guess=(0.0, 2.0 * math.pi))  # [rad]
    ocp.duration(DURATION)

    ocp.minimise(terminal=-r)

    acceleration = THRUST / (1 - FUEL_FLOW * ocp.t)
    ocp.dynamics(r, w)
    ocp.dynamics(w, v**2 / r - 1 / r**2 + acceleration * ca.sin(phi))
    ocp.dynamics(v, -w * v / r + acceleration * ca.cos(phi))

    for state, value in ((r, 1.0), (w, 0.0), (v, 1.0)):
        ocp.start(state, value)
    ocp.end(w, 0.0)
    ocp.end_constraint(v - 1 / ca.sqrt(r))
    return ocp.functions()
