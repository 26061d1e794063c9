"""A state held below a parabola in time: "stc1" (Jacobson and Lele, 1969; Teo, Goh and Wong; PSOPT).

    minimise ∫_0^1 x1^2 + x2^2 + 0.005 u^2 dt   subject to   x1' = x2,   x2' = -x2 + u,   |u| <= 20,
                                                             x2 <= 8 (t - 1/2)^2 - 1/2,   x(0) = (0, -1)

The optimum follows the parabola for a while: J* = 0.1698205.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def moving_wall() -> ProblemFunctions:
    """Regulation within one second below a parabola."""
    ocp = OptimalControlProblem("stc1")

    x1 = ocp.state("x1", lower=-2.0, upper=2.0)
    x2 = ocp.state("x2", lower=-2.0, upper=2.0, guess=(-1.0, 0.0))
    u = ocp.control("u", lower=-20.0, upper=20.0, scale=5.0)
    ocp.duration(1.0)

    ocp.minimise(running=x1**2 + x2**2 + 0.005 * u**2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x2 + u)

    ocp.constrain(8 * (ocp.t - 0.5) ** 2 - 0.5 - x2, lower=0.0)

    ocp.start(x1, 0.0)
    ocp.start(x2, -1.0)
    return ocp.functions()
