"""Soft landing with the least fuel, the mass falling as fuel burns (manuals of PROPT and PSOPT, "moon lander").

    minimise ∫_0^T F dt   subject to   h' = v,   v' = -1 + F / m,   m' = -F / 2.349,   0 <= F <= 1.227,
                                       (1, -0.783, 1) to h = 0, v = 0,   T free

The optimum falls and then brakes with all it has: J* = 1.4203128.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

GRAVITY, MOST_THRUST, EXHAUST_SPEED = 1.0, 1.227, 2.349


@cache
def lander() -> ProblemFunctions:
    """Landing from a height of 1 at a speed of -0.783."""
    ocp = OptimalControlProblem("lander")

    h = ocp.state("h", lower=-20.0, upper=20.0, guess=(1.0, 0.0))
    v = ocp.state("v", lower=-20.0, upper=20.0, guess=(-0.783, 0.0))
    m = ocp.state("m", lower=0.01, upper=1.0, guess=(1.0, 0.2))
    F = ocp.control("F", lower=0.0, upper=MOST_THRUST, guess=(MOST_THRUST / 2, MOST_THRUST / 2))
    ocp.free_duration(guess=1.5, lower=0.1, upper=1000.0)

    ocp.minimise(running=F)

    ocp.dynamics(h, v)
    ocp.dynamics(v, -GRAVITY + F / m)
    ocp.dynamics(m, -F / EXHAUST_SPEED)

    ocp.start(h, 1.0)
    ocp.start(v, -0.783)
    ocp.start(m, 1.0)
    ocp.end(h, 0.0)
    ocp.end(v, 0.0)
    return ocp.functions()
