"""Bryson's maximum range: a body of constant thrust flies as far as it can in a given time (Bryson, 1999; PSOPT).

    maximise x(2)   subject to   x' = v cos θ,   y' = v sin θ,   v' = a - g sin θ,   a = g / 2,   g = 1,
                                 rest at 0 to y(2) = 0.1

x(2)* = 1.7123149.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

GRAVITY, ACCELERATION = 1.0, 0.5


@cache
def maximum_range() -> ProblemFunctions:
    """Farthest flight in two seconds that ends at a height of 0.1."""
    ocp = OptimalControlProblem("maximum range")

    x = ocp.state("x", guess=(0.0, 1.0))
    y = ocp.state("y", guess=(0.0, 0.1))
    v = ocp.state("v", guess=(0.0, 1.0))
    theta = ocp.control("theta", guess=(0.0, 0.0))  # [rad]
    ocp.duration(2.0)

    ocp.minimise(terminal=-x)

    ocp.dynamics(x, v * ca.cos(theta))
    ocp.dynamics(y, v * ca.sin(theta))
    ocp.dynamics(v, ACCELERATION - GRAVITY * ca.sin(theta))

    for state in (x, y, v):
        ocp.start(state, 0.0)
    ocp.end(y, 0.1)
    return ocp.functions()
