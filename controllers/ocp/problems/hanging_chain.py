"""The chain that hangs between two points with the least potential energy (Johann Bernoulli 1691; COPS 3).

    minimise ∫_0^1 x sqrt(1 + u^2) dt   subject to   x' = u,   l' = sqrt(1 + u^2),   (1, 0) to (3, 4)

An integral is given, the length 4: the optimum is a catenary, J* = 5.0684801.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

LENGTH, START, END = 4.0, 1.0, 3.0


@cache
def hanging_chain() -> ProblemFunctions:
    """Chain of length 4 from a height of 1 to one of 3 over a distance of 1."""
    ocp = OptimalControlProblem("hanging chain")

    x = ocp.state("x", guess=(START, END))
    length = ocp.state("length", scale=LENGTH, guess=(0.0, LENGTH))
    u = ocp.control("u", scale=5.0, guess=(END - START, END - START))
    ocp.duration(1.0)

    stretch = ca.sqrt(1 + u**2)
    ocp.minimise(running=x * stretch)

    ocp.dynamics(x, u)
    ocp.dynamics(length, stretch)

    ocp.start(x, START)
    ocp.start(length, 0.0)
    ocp.end(x, END)
    ocp.end(length, LENGTH)
    return ocp.functions()
