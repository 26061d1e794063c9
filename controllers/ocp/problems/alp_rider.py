"""The alp rider: stiff dynamics that must stay above a landscape of four narrow peaks in time (Betts, SOS).

    minimise ∫_0^20 100 |x|^2 + 0.01 |u|^2 dt   subject to   (2, 1, 2, 1) to (2, 3, 1, -2),
        x1' = -10 x1 + u1 + u2,              x2' = -2 x2 + u1 + 2 u2,
        x3' = -3 x3 + 5 x4 + u1 - u2,        x4' = 5 x3 - 3 x4 + u1 + 3 u2,
        |x|^2 >= 3 p(t; 3, 12) + 3 p(t; 6, 10) + 3 p(t; 10, 6) + 8 p(t; 15, 4) + 0.01,   p(t; a, b) = exp(-b (t - a)^2)

The constraint binds from t = 0.36 to 18.43, between layers of 0.01 s at both ends: J* = 2030.8543. Ways over a peak
with x mirrored to -x are local optima that cost 1e-7 more.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

PEAKS = ((3.0, 3.0, 12.0), (3.0, 6.0, 10.0), (3.0, 10.0, 6.0), (8.0, 15.0, 4.0))  # height, a, b
START, END = (2.0, 1.0, 2.0, 1.0), (2.0, 3.0, 1.0, -2.0)


@cache
def alp_rider() -> ProblemFunctions:
    """Ride over four peaks in 20 s."""
    ocp = OptimalControlProblem("alp rider")

    x = ca.vertcat(*(ocp.state(f"x{k + 1}", guess=(START[k], 1.0, END[k])) for k in range(4)))
    x1, x2, x3, x4 = ca.vertsplit(x)
    u1 = ocp.control("u1", scale=10.0)
    u2 = ocp.control("u2", scale=10.0)
    ocp.duration(20.0)

    ocp.minimise(running=100 * ca.sumsqr(x) + 0.01 * (u1**2 + u2**2))

    ocp.dynamics(x1, -10 * x1 + u1 + u2)
    ocp.dynamics(x2, -2 * x2 + u1 + 2 * u2)
    ocp.dynamics(x3, -3 * x3 + 5 * x4 + u1 - u2)
    ocp.dynamics(x4, 5 * x3 - 3 * x4 + u1 + 3 * u2)

    landscape = sum((height * ca.exp(-b * (ocp.t - a) ** 2) for height, a, b in PEAKS), ca.SX(0.01))
    ocp.constrain(ca.sumsqr(x) - landscape, lower=0.0)

    for state, start, end in zip((x1, x2, x3, x4), START, END, strict=True):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()
