"""Goddard's rocket: the greatest height for a given amount of fuel, against drag and gravity (COPS 3, problem 10).

    maximise h(T)   subject to   h' = v,   v' = (F - D(h, v)) / m - 1 / h^2,   m' = -2 F,
                                 D = 310 v^2 exp(-500 (h - 1)),   0 <= F <= 3.5,   (1, 0, 1) to m = 0.6,   T free

In units of the planet's radius, its gravity and the take-off mass. The optimum climbs at full thrust until m / h^2 = D
(1 + 2 v), stays on this singular arc until the fuel is spent, and coasts: h(T)* = 1.0128369. COPS prints 1.01283. The
often seen 1.0128436 comes from a coarse collocation, which overestimates; no control reaches it.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def goddard() -> ProblemFunctions:
    """Flight of Goddard's rocket to the greatest height, in the scaled units of COPS."""
    ocp = OptimalControlProblem("Goddard")

    h = ocp.state("h", lower=1.0, scale=0.01, guess=(1.0, 1.01))
    v = ocp.state("v", lower=0.0, scale=0.1, guess=(0.0, 0.1, 0.0))
    m = ocp.state("m", lower=0.6, upper=1.0, guess=(1.0, 0.6))
    F = ocp.control("F", lower=0.0, upper=3.5, scale=3.5, guess=(3.5, 0.0))
    ocp.free_duration(guess=0.2, lower=0.05, upper=1.0)

    ocp.minimise(terminal=-h)

    ocp.dynamics(h, v)
    ocp.dynamics(v, (F - 310 * v**2 * ca.exp(-500 * (h - 1))) / m - 1 / h**2)
    ocp.dynamics(m, -2 * F)

    ocp.start(h, 1.0)
    ocp.start(v, 0.0)
    ocp.start(m, 1.0)
    ocp.end(m, 0.6)
    return ocp.functions()
