"""A double integrator regulated without a price on the control (Bell and Jacobson, 1975; Fraser-Andrews, 1996).

    minimise ∫_0^5 x^2 + v^2 dt   subject to   x' = v,   v' = u,   |u| <= 1,   (x, v)(0) = (0, 1)

The optimum brakes with all it has and then follows the singular control u = x: J* = 0.75398386.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def singular_regulator() -> ProblemFunctions:
    """Regulation within 5 s, without a cost of the control."""
    ocp = OptimalControlProblem("singular regulator")

    x = ocp.state("x")
    v = ocp.state("v", guess=(1.0, 0.0))
    u = ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(5.0)

    ocp.minimise(running=x**2 + v**2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    return ocp.functions()
