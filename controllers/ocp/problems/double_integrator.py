"""The double integrator, x' = v, v' = u, with the least energy and in the least time: both are solved on paper.

energy   1/2 ∫_0^1 u^2 dt from (0, 0) to x(1) = 1:   J* = 6 with v(1) = 0,   J* = 3/2 with v(1) free
time     T from rest to rest over a distance of 3, |u| <= 1:   T* = 2 sqrt(3), u = 1 and then -1
"""

from __future__ import annotations

import math
from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

DISTANCE = 3.0


@cache
def double_integrator_energy(end_at_rest: bool = True) -> ProblemFunctions:
    """Least energy over a distance of 1 in one second."""
    ocp = OptimalControlProblem(f"double integrator, energy, v(T) {'fixed' if end_at_rest else 'free'}")

    x = ocp.state("x", guess=(0.0, 1.0))
    v = ocp.state("v", guess=(0.0, 1.0))
    u = ocp.control("u", scale=5.0)
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, 1.0)
    if end_at_rest:
        ocp.end(v, 0.0)
    return ocp.functions()


@cache
def double_integrator_time() -> ProblemFunctions:
    """Least time from rest to rest."""
    ocp = OptimalControlProblem("double integrator, time")

    x = ocp.state("x", scale=DISTANCE, guess=(0.0, DISTANCE))
    v = ocp.state("v", scale=math.sqrt(DISTANCE), guess=(0.0, 1.0, 0.0))
    u = ocp.control("u", lower=-1.0, upper=1.0, guess=(1.0, -1.0))
    T = ocp.free_duration(guess=4.0, lower=0.5, upper=20.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, DISTANCE)
    ocp.end(v, 0.0)
    return ocp.functions()
