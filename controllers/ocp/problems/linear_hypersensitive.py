"""The linear hypersensitive problem: two boundary layers that a short horizon lets touch (Rao and Mease, 1999).

    minimise 1/2 ∫_0^10 x^2 + u^2 dt   subject to   x' = -x + u,   x(0) = 1.5,   x(10) = 1

Linear and quadratic: x = A e^(√2 t) + B e^(-√2 t), J* = 1.67309398.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def linear_hypersensitive() -> ProblemFunctions:
    """Transfer from 1.5 to 1 in 10 s."""
    ocp = OptimalControlProblem("linear hypersensitive")

    x = ocp.state("x", guess=(1.5, 1.0))
    u = ocp.control("u")
    ocp.duration(10.0)

    ocp.minimise(running=(x**2 + u**2) / 2)

    ocp.dynamics(x, -x + u)

    ocp.start(x, 1.5)
    ocp.end(x, 1.0)
    return ocp.functions()
