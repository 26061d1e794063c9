"""Fishing that brings prey and predator to rest: Lotka and Volterra's equations, relaxed (Sager, 2006; mintoc.de).

    minimise ∫_0^12 (x1 - 1)^2 + (x2 - 1)^2 dt   subject to   x1' = x1 - x1 x2 - 0.4 x1 u,
        x2' = -x2 + x1 x2 - 0.2 x2 u,   0 <= u <= 1,   x(0) = (0.5, 0.7)

No fishing, all of it, a singular arc, and none at the end: J* = 1.3440812.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def fishing() -> ProblemFunctions:
    """Prey and predator brought to (1, 1) within 12 time units."""
    ocp = OptimalControlProblem("fishing")

    x1 = ocp.state("x1", lower=0.0, guess=(0.5, 1.0))
    x2 = ocp.state("x2", lower=0.0, guess=(0.7, 1.0))
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.duration(12.0)

    ocp.minimise(running=(x1 - 1) ** 2 + (x2 - 1) ** 2)

    ocp.dynamics(x1, x1 - x1 * x2 - 0.4 * x1 * u)
    ocp.dynamics(x2, -x2 + x1 * x2 - 0.2 * x2 * u)

    ocp.start(x1, 0.5)
    ocp.start(x2, 0.7)
    return ocp.functions()
