"""The van der Pol oscillator steered between two states in the least time (Maurer, Büskens, Kim and Kaya, 2005).

    minimise T   subject to   x1' = x2,   x2' = -x1 + x2 (1 - x1^2) + u,   |u| <= 1,   (-0.4, 0.6) to (0.6, 0.4)

The control is bang-bang with one switch: T* = 1.2540747.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

START, END = (-0.4, 0.6), (0.6, 0.4)


@cache
def van_der_pol_time() -> ProblemFunctions:
    """Fastest way from (-0.4, 0.6) to (0.6, 0.4)."""
    ocp = OptimalControlProblem("van der Pol, time")

    x1 = ocp.state("x1", guess=(START[0], END[0]))
    x2 = ocp.state("x2", guess=(START[1], END[1]))
    u = ocp.control("u", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=1.0, lower=0.1, upper=10.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x1 + x2 * (1 - x1**2) + u)

    for state, start, end in zip((x1, x2), START, END, strict=True):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()
