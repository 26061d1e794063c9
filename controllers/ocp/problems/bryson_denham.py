"""Bryson-Denham: turn a body around before a wall with the least energy (Bryson and Ho, Applied Optimal Control).

    minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   x <= L,   (0, 1) to (0, -1)

For L <= 1/6 the optimum J* = 4 / (9 L) rests on the wall between t = 3 L and 1 - 3 L: 4 for L = 1/9, 40/9 for L = 0.1.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

WALL = 1.0 / 9.0


@cache
def bryson_denham(wall: float = WALL) -> ProblemFunctions:
    """Turn before the wall x <= ``wall`` within one second."""
    ocp = OptimalControlProblem(f"Bryson-Denham, L = {wall:.4g}")

    x = ocp.state("x", upper=wall, scale=0.1, guess=(0.0, 0.1, 0.0))
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
