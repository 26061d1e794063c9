"""The van der Pol oscillator, brought to rest with a control that is bounded on one side.

    minimise ∫_0^20 x1^2 + x2^2 + u^2 dt   subject to   x1' = (1 - x2^2) x1 - x2 + u,   x2' = x1,
                                                        u <= 0.75,   x(0) = (0, 1)

J* = 3.1749818; JModelica's documentation prints 3.1761958, with 50 elements.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def van_der_pol() -> ProblemFunctions:
    """Regulation to rest within 20 s."""
    ocp = OptimalControlProblem("van der Pol")

    x1 = ocp.state("x1")
    x2 = ocp.state("x2", guess=(1.0, 0.0))
    u = ocp.control("u", upper=0.75)
    ocp.duration(20.0)

    ocp.minimise(running=x1**2 + x2**2 + u**2)

    ocp.dynamics(x1, (1 - x2**2) * x1 - x2 + u)
    ocp.dynamics(x2, x1)

    ocp.start(x1, 0.0)
    ocp.start(x2, 1.0)
    return ocp.functions()
