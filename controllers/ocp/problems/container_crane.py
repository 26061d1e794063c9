"""A container crane that moves its load with the least swing (Sakawa and Shindo, 1982; Teo, Goh and Wong; PSOPT).

    minimise 1/2 ∫_0^9 x3^2 + x6^2 dt   subject to   x1' = x4,   x2' = x5,   x3' = x6,
        x4' = u1 + 17.2656 x3,   x5' = u2,   x6' = -(u1 + 27.0756 x3 + 2 x5 x6) / x2,
        |u1| <= 2.83374,   -0.80865 <= u2 <= 0.71265,   |x4| <= 2.5,   |x5| <= 1,
        (0, 22, 0, 0, -1, 0) to (10, 14, 0, 2.5, 0, 0)

x1 is the trolley's place, x2 the length of the rope, x3 its angle. Both controls enter linearly and cost nothing:
bangs, singular arcs and arcs on the bounds of the speeds. J* = 5.15043e-3; 5.14982e-3 is often seen, of a grid too coarse.
"""

from __future__ import annotations

from functools import cache

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

START, END = (0.0, 22.0, 0.0, 0.0, -1.0, 0.0), (10.0, 14.0, 0.0, 2.5, 0.0, 0.0)


@cache
def container_crane() -> ProblemFunctions:
    """Transfer of a container in 9 s with the least swing."""
    ocp = OptimalControlProblem("container crane")

    speeds = {"x4": 2.5, "x5": 1.0}  # bounds
    scales = (10.0, 10.0, 0.1, 2.5, 1.0, 0.1)
    x = [
        ocp.state(
            f"x{k + 1}",
            lower=-speeds.get(f"x{k + 1}", 50.0),
            upper=speeds.get(f"x{k + 1}", 50.0),
            scale=scales[k],
            guess=(START[k], END[k]),
        )
        for k in range(6)
    ]
    _, x2, x3, x4, x5, x6 = x
    u1 = ocp.control("u1", lower=-2.83374, upper=2.83374)
    u2 = ocp.control("u2", lower=-0.80865, upper=0.71265)
    ocp.duration(9.0)

    ocp.minimise(running=(x3**2 + x6**2) / 2)

    rates = (x4, x5, x6, u1 + 17.2656 * x3, u2, -(u1 + 27.0756 * x3 + 2 * x5 * x6) / x2)
    for state, rate, start, end in zip(x, rates, START, END, strict=True):
        ocp.dynamics(state, rate)
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()
