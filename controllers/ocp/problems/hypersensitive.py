"""The hypersensitive problem: a boundary layer at either end, and nothing in between (Rao and Mease, 2000).

    minimise 1/2 ∫_0^T x^2 + u^2 dt   subject to   x' = -x^3 + u,   x(0) and x(T) given

For large T the optimum does not depend on T: it goes to rest along one branch of u = x^3 ± x sqrt(x^4 + 1) and away
along the other. With J = S(x(0), -1) + S(x(T), 1), S(a, ±1) = ∫_0^a x sqrt(x^4 + 1) ± x^3 dx,

    J* = 3.3620571 from 1 to 1.5 in T = 10^4,        J* = 1.3308069 from 1.5 to 1 in T = 50.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def hypersensitive() -> ProblemFunctions:
    """Transfer from 1 to 1.5 in 10^4 s: the layers take a thousandth of the time."""
    return _layers("hypersensitive", 1.0, 1.5, 1e4)


@cache
def hypersensitive_short() -> ProblemFunctions:
    """Transfer from 1.5 to 1 in 50 s."""
    return _layers("hypersensitive, short", 1.5, 1.0, 50.0)


def _layers(name: str, start: float, end: float, duration: float) -> ProblemFunctions:
    ocp = OptimalControlProblem(name)

    x = ocp.state("x", guess=(start, 0.0, end))
    u = ocp.control("u")
    ocp.duration(duration)

    ocp.minimise(running=(x**2 + u**2) / 2)

    ocp.dynamics(x, -(x**3) + u)

    ocp.start(x, start)
    ocp.end(x, end)
    return ocp.functions()
