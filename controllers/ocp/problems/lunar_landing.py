"""Soft landing on the moon with the least fuel, the mass constant (Meditch, IEEE TAC 9, 1964; GPOPS-II manual).

    minimise ∫_0^T u dt   subject to   h' = v,   v' = u - g,   0 <= u <= 3,   g = 1.5,   (10, -2) to (0, 0),   T free

The optimum falls and then brakes with all it has: J* = 2 √17.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

GRAVITY, MOST_THRUST = 1.5, 3.0


@cache
def lunar_landing() -> ProblemFunctions:
    """Landing from a height of 10 at a speed of -2."""
    ocp = OptimalControlProblem("lunar landing")

    h = ocp.state("h", scale=10.0, guess=(10.0, 0.0))
    v = ocp.state("v", scale=5.0, guess=(-2.0, 0.0))
    u = ocp.control("u", lower=0.0, upper=MOST_THRUST, guess=(0.0, MOST_THRUST))
    ocp.free_duration(guess=5.0, lower=0.5, upper=200.0)

    ocp.minimise(running=u)

    ocp.dynamics(h, v)
    ocp.dynamics(v, u - GRAVITY)

    ocp.start(h, 10.0)
    ocp.start(v, -2.0)
    ocp.end(h, 0.0)
    ocp.end(v, 0.0)
    return ocp.functions()
