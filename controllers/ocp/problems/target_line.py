"""The double integrator driven onto a line with the least energy (Locatelli, Optimal Control of a Double Integrator).

    minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   (0, 0) to x(1) - 2 v(1) = 1

The costate at the end is normal to the line: u = -3/7 (1 + t), J* = 3/14.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def target_line() -> ProblemFunctions:
    """Least energy to the line x - 2 v = 1 in one second."""
    ocp = OptimalControlProblem("target line")

    x = ocp.state("x")
    v = ocp.state("v")
    u = ocp.control("u")
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end_constraint(x - 2 * v, lower=1.0, upper=1.0)
    return ocp.functions()
