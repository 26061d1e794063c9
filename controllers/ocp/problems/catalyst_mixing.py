"""Two catalysts mixed along a reactor so that it yields the most (Gunn and Thomas, 1965; COPS 3).

    minimise x1(1) + x2(1) - 1   subject to   x1' = u (10 x2 - x1),   x2' = u (x1 - 10 x2) - (1 - u) x2,
                                              0 <= u <= 1,   x(0) = (1, 0)

u is the fraction of the first catalyst: all of it, a singular arc, none of it. J* = -0.04805568.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def catalyst_mixing() -> ProblemFunctions:
    """Most product at the end of a reactor of length 1."""
    ocp = OptimalControlProblem("catalyst mixing")

    x1 = ocp.state("x1", guess=(1.0, 1.0))
    x2 = ocp.state("x2", scale=0.1)
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.duration(1.0)

    ocp.minimise(terminal=x1 + x2 - 1)

    ocp.dynamics(x1, u * (10 * x2 - x1))
    ocp.dynamics(x2, u * (x1 - 10 * x2) - (1 - u) * x2)

    ocp.start(x1, 1.0)
    ocp.start(x2, 0.0)
    return ocp.functions()
