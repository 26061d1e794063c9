"""The missile of the thesis' design study (B.4): dive onto a target at a right angle.

Pitch plane, z down, nose up positive. The thesis leaves the objective open; the cases differ in the cost of braking, of
a steep angle of attack and of turning. The aspect angle pins θ and w: with three inputs, three degrees of freedom and
no aerodynamics θ alone says nothing about the path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.errors import ProblemError
from mathnavi.models.missile.dynamics import NOMINAL, pitch_rates
from mathnavi.models.missile.mission import CASES


@dataclass(frozen=True)
class Optimum:
    """Optimal cost and final time (``python -m benchmarks.ocp_references``)."""

    cost: float  # J*
    duration: float  # [s] T*


OPTIMA = {
    "SM": Optimum(13.0147119, 8.06965),
    "SM2": Optimum(11.54117311, 8.271096),
    "SM3": Optimum(10.73314171, 8.0139),
    "FAST": Optimum(11.35834097, 4.50558),
}


@cache
def missile(case: str = "SM2") -> ProblemFunctions:
    """Dive from (0, 10) m in level flight to (700, 0) m straight down; ProblemError for an unknown case."""
    if case not in CASES:
        raise ProblemError(f"case = {case!r}; allowed: {', '.join(CASES)}")
    c, T = CASES[case], OPTIMA[case].duration
    m, I_y, g, V_0 = NOMINAL.mass, NOMINAL.inertia, NOMINAL.gravity, c.speed
    ocp = OptimalControlProblem(f"missile, {case}")

    u = ocp.state("u", lower=1.0, scale=100.0, guess=(V_0, V_0))
    w = ocp.state("w", scale=100.0)
    q = ocp.state("q", scale=1.0)
    theta = ocp.state("theta", scale=1.0, guess=(0.0, 1.0, 0.5, -1.0, -math.pi / 2))
    x_e = ocp.state("x_e", scale=100.0, guess=(0.0, 200.0, 450.0, 650.0, 700.0))
    z_e = ocp.state("z_e", scale=100.0, guess=(-10.0, -80.0, -120.0, -80.0, 0.0))
    F_x = ocp.control("F_x", scale=5.0 * m * g)
    F_z = ocp.control("F_z", scale=5.0 * m * g)
    M = ocp.control("M", scale=2.0 * I_y)
    ocp.free_duration(guess=T, lower=0.5, upper=60.0)

    # ``mission.running_cost`` in the pitch plane, in the order in which the reference optima were computed.
    ocp.minimise(
        running=1
        + c.a_x * (F_x / (m * g)) ** 2
        + c.a_z * (F_z / (m * g)) ** 2
        + c.b * (M / I_y) ** 2
        + c.k * (w / u) ** 2
    )

    x = (u, w, q, theta, x_e, z_e)
    for state, rate in zip(x, pitch_rates(x, (F_x, F_z, M), NOMINAL, sin=ca.sin, cos=ca.cos), strict=True):
        ocp.dynamics(state, rate)

    for state, value in ((u, V_0), (w, 0.0), (q, 0.0), (theta, 0.0), (x_e, 0.0), (z_e, -10.0)):
        ocp.start(state, value)
    for state, value in ((w, 0.0), (theta, -math.pi / 2), (x_e, 700.0), (z_e, 0.0)):
        ocp.end(state, value)
    return ocp.functions()
