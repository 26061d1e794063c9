"""A stirred-tank reactor brought back to its unstable rest (Lapidus and Luus, 1967; Luus and Cormack, 1972).

    minimise ∫_0^0.78 x1^2 + x2^2 + 0.1 u^2 dt   subject to   x1' = -2 (x1 + 0.25) + r - u (x1 + 0.25),
        x2' = 0.5 - x2 - r,   r = (x2 + 0.5) exp(25 x1 / (x1 + 2)),   x(0) = (0.09, 0.09)

x1 and x2 are the deviations of temperature and concentration. There are two local optima: J* = 0.13309573 and 0.2444.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def stirred_tank() -> ProblemFunctions:
    """Regulation of a stirred tank within 0.78 time units."""
    ocp = OptimalControlProblem("stirred tank")

    x1 = ocp.state("x1", lower=-0.5, upper=1.0, scale=0.1, guess=(0.09, 0.0))
    x2 = ocp.state("x2", lower=-0.5, upper=1.0, scale=0.1, guess=(0.09, 0.0))
    u = ocp.control("u", guess=(2.5, 2.5))
    ocp.duration(0.78)

    ocp.minimise(running=x1**2 + x2**2 + 0.1 * u**2)

    reaction = (x2 + 0.5) * ca.exp(25 * x1 / (x1 + 2))
    ocp.dynamics(x1, -2 * (x1 + 0.25) + reaction - u * (x1 + 0.25))
    ocp.dynamics(x2, 0.5 - x2 - reaction)

    ocp.start(x1, 0.09)
    ocp.start(x2, 0.09)
    return ocp.functions()
