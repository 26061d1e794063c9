"""Rayleigh's oscillator with a constraint on state and control together (Betts, SOS; Maurer and Augustin, 2001).

    minimise ∫_0^4.5 u^2 + x1^2 dt   subject to   x1' = x2,   x2' = -x1 + x2 (1.4 - 0.14 x2^2) + 4 u,
                                                  u + x1 / 6 <= 0,   x(0) = (-5, -5)

J* = 44.804444.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def rayleigh() -> ProblemFunctions:
    """Rayleigh's oscillator in 4.5 s, with the mixed constraint u + x1 / 6 <= 0."""
    ocp = OptimalControlProblem("Rayleigh")

    x1 = ocp.state("x1", scale=5.0, guess=(-5.0, 0.0))
    x2 = ocp.state("x2", scale=5.0, guess=(-5.0, 0.0))
    u = ocp.control("u")
    ocp.duration(4.5)

    ocp.minimise(running=u**2 + x1**2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x1 + x2 * (1.4 - 0.14 * x2**2) + 4 * u)

    ocp.constrain(u + x1 / 6, upper=0.0)

    ocp.start(x1, -5.0)
    ocp.start(x2, -5.0)
    return ocp.functions()
