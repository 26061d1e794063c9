"""The missile of the thesis' design study (B.4): dive onto a target at a right angle.

Pitch plane, z down, nose up positive. The print leaves the objective open; the cases differ in how dear braking, a
steep angle of attack and turning are. The aspect angle pins θ and w: with three inputs, three degrees of freedom and no
aerodynamics θ alone says nothing about the path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.statement import OptimalControlProblem, Statement
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import CASES


@dataclass(frozen=True)
class Optimum:
    """Of an independent computation."""

    cost: float  # J*
    duration: float  # [s] T*


OPTIMA = {
    "SM": Optimum(13.01471, 8.06965),
    "SM2": Optimum(11.541173, 8.271096),
    "SM3": Optimum(10.733142, 8.0139),
    "FAST": Optimum(11.358341, 4.50558),
}


@cache
def missile(case: str = "SM2") -> OptimalControlProblem:
    """From (0, 10) at level flight to (700, 0) straight down."""
    if case not in CASES:
        raise ValueError(f"case = {case!r}; allowed: {', '.join(CASES)}")
    c, T = CASES[case], OPTIMA[case].duration
    m, I_y, g, V_0 = NOMINAL.mass, NOMINAL.inertia, NOMINAL.gravity, c.speed
    ocp = Statement(f"missile, {case}")

    u = ocp.state("u", lower=1.0, scale=100.0, guess=(V_0, V_0))
    w = ocp.state("w", scale=100.0)
    q = ocp.state("q", scale=1.0)
    theta = ocp.state("theta", scale=1.0, guess=(0.0, 1.0, 0.5, -1.0, -math.pi / 2))
    x = ocp.state("x_e", scale=100.0, guess=(0.0, 200.0, 450.0, 650.0, 700.0))
    z = ocp.state("z_e", scale=100.0, guess=(-10.0, -80.0, -120.0, -80.0, 0.0))
    F_x = ocp.control("F_x", scale=5.0 * m * g)
    F_z = ocp.control("F_z", scale=5.0 * m * g)
    M = ocp.control("M", scale=2.0 * I_y)
    ocp.free_duration(guess=T, lower=0.5, upper=60.0)

    ocp.minimise(
        running=1
        + c.a_x * (F_x / (m * g)) ** 2
        + c.a_z * (F_z / (m * g)) ** 2
        + c.b * (M / I_y) ** 2
        + c.k * (w / u) ** 2
    )

    ocp.dynamics(u, F_x / m - q * w - g * ca.sin(theta))
    ocp.dynamics(w, F_z / m + q * u + g * ca.cos(theta))
    ocp.dynamics(q, M / I_y)
    ocp.dynamics(theta, q)
    ocp.dynamics(x, u * ca.cos(theta) + w * ca.sin(theta))
    ocp.dynamics(z, -u * ca.sin(theta) + w * ca.cos(theta))

    for state, value in ((u, V_0), (w, 0.0), (q, 0.0), (theta, 0.0), (x, 0.0), (z, -10.0)):
        ocp.start(state, value)
    for state, value in ((w, 0.0), (theta, -math.pi / 2), (x, 700.0), (z, 0.0)):
        ocp.end(state, value)
    return ocp.problem()
