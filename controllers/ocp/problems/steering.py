"""A particle of constant thrust, steered to a height and a speed in the least time (Bryson and Ho, 2.4; COPS 3).

    minimise T   subject to   x'' = a cos θ,   y'' = a sin θ,   |θ| <= π/2,   a = 100,
                              rest at 0 to y = 5, x' = 45, y' = 0

The optimum follows the linear tangent law tan θ = c (1 - 2 t / T): T* = 0.55457088.
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

THRUST, HEIGHT, SPEED = 100.0, 5.0, 45.0


@cache
def steering() -> ProblemFunctions:
    """Fastest way from rest to a height of 5 and a horizontal speed of 45."""
    ocp = OptimalControlProblem("steering")

    x = ocp.state("x", scale=10.0)
    y = ocp.state("y", scale=5.0, guess=(0.0, HEIGHT))
    dx = ocp.state("dx", scale=45.0, guess=(0.0, SPEED))
    dy = ocp.state("dy", scale=45.0)
    theta = ocp.control("theta", lower=-math.pi / 2, upper=math.pi / 2)  # [rad]
    T = ocp.free_duration(guess=1.0, lower=0.1, upper=10.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, dx)
    ocp.dynamics(y, dy)
    ocp.dynamics(dx, THRUST * ca.cos(theta))
    ocp.dynamics(dy, THRUST * ca.sin(theta))

    for state in (x, y, dx, dy):
        ocp.start(state, 0.0)
    for state, value in ((y, HEIGHT), (dx, SPEED), (dy, 0.0)):
        ocp.end(state, value)
    return ocp.functions()
