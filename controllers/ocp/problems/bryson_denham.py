"""Bryson-Denham: turn a body around before a wall with the least energy (Bryson and Ho, Applied Optimal Control).

    minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   x <= L = 1/9,   (0, 1) to (0, -1)

For L <= 1/6 the optimum J* = 4 / (9 L) = 4 rests on the wall between t = 3 L and 1 - 3 L.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

WALL = 1.0 / 9.0


@cache
def bryson_denham() -> ProblemFunctions:
    """Turn before the wall x <= 1/9 within one second."""
    ocp = OptimalControlProblem("Bryson-Denham")

    x = ocp.state("x", upper=WALL, scale=0.1, guess=(0.0, 0.1, 0.0))
    v = ocp.state("v", guess=(1.0, -1.0))
    u = ocp.control("u", scale=5.0)
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    ocp.end(x, 0.0)
    ocp.end(v, -1.0)
    return ocp.functions()
