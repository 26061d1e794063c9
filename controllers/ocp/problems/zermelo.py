"""Zermelo's problem: the fastest crossing of a current that grows with the distance (Zermelo 1931; Bryson and Ho, 2.7).

    minimise T   subject to   x' = cos θ - y,   y' = sin θ,   (3.66, -1.86) to (0, 0)

in units of the ship's speed. The heading obeys θ' = cos^2 θ, tan θ is linear in t: T* = 5.4578653.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

START = (3.66, -1.86)


@cache
def zermelo() -> ProblemFunctions:
    """Fastest way to the origin through the current (-y, 0)."""
    ocp = OptimalControlProblem("Zermelo")

    x = ocp.state("x", scale=3.0, guess=(START[0], 0.0))
    y = ocp.state("y", scale=3.0, guess=(START[1], 0.0))
    theta = ocp.control("theta", guess=(math.pi, math.pi))  # [rad]
    T = ocp.free_duration(guess=math.hypot(*START), lower=0.1, upper=100.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, ca.cos(theta) - y)
    ocp.dynamics(y, ca.sin(theta))

    for state, start in ((x, START[0]), (y, START[1])):
        ocp.start(state, start)
        ocp.end(state, 0.0)
    return ocp.functions()
