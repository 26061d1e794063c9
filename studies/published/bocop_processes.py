"""Bocop's processes: a bioreactor, a reactor with two catalysts, and a heated bar with either end condition.

Limits, constants and starting values are those of each ``problem.def``; Bocop starts at 0.1 what a file does not name.
"""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.bocop_mechanics import INIT


def bioreactor_1day_periodic() -> OptimalControlProblem:
    """Methane out of algae that grow by day: the most over a day that repeats itself (Bocop: bioreactor_1day_periodic).

        maximise ∫_0^10 μ_2(s) x / 3 dt   subject to   y' = μ(t) y / (1 + y) - (0.005 + u) y,
            s' = -μ_2(s) x + u (y - s),   x' = (μ_2(s) - u) x,   0 <= u <= 1,
            μ_2 = 0.1 s / (s + 0.05),   μ = max(0, sin(2π t / 10))^2,
            y, s >= 0,   x >= 0.001,   y(0) >= 1,   x(0) >= 1,   (y, s, x)(10) = (y, s, x)(0)

    y are algae, s is what is left of them to eat, x the bacteria that turn it into methane, u the dilution.
    """
    ocp = OptimalControlProblem("bioreactor, one day")
    y = ocp.state("y", lower=0.0, guess=50.0)
    s = ocp.state("s", lower=0.0, guess=50.0)
    x = ocp.state("x", lower=0.001, guess=50.0)
    u = ocp.control("u", lower=0.0, upper=1.0, guess=INIT)
    ocp.duration(10.0)

    digestion = 0.1 * s / (s + 0.05)
    light = ca.if_else(ocp.t < 5.0, ca.sin(2 * math.pi * ocp.t / 10) ** 2, 0.0)
    ocp.minimise(running=-digestion * x / 3)
    ocp.dynamics(y, light * y / (1 + y) - (0.005 + u) * y)
    ocp.dynamics(s, -digestion * x + u * (y - s))
    ocp.dynamics(x, (digestion - u) * x)
    ocp.start_constraint(y >= 1)
    ocp.start_constraint(x >= 1)
    ocp.periodic(y, s, x)
    return ocp


def jackson_basic() -> OptimalControlProblem:
    """Two catalysts, one for A to B and back, one for B to C: the most C (Jackson 1968; Bocop: jackson_basic).

        maximise c(4)   subject to   a' = -u (a - 10 b),   b' = u (a - 10 b) - (1 - u) b,   c' = (1 - u) b,
                                     0 <= u <= 1,   a, b, c >= 0,   (1, 0, 0) to anywhere

    All of the first, a singular arc, none of it.
    """
    ocp = OptimalControlProblem("Jackson")
    a, b, c = (ocp.state(name, lower=0.0, guess=INIT) for name in "abc")
    u = ocp.control("u", lower=0.0, upper=1.0, guess=INIT)
    ocp.duration(4.0)

    ocp.minimise(terminal=-c)
    ocp.dynamics(a, -u * (a - 10 * b))
    ocp.dynamics(b, u * (a - 10 * b) - (1 - u) * b)
    ocp.dynamics(c, (1 - u) * b)
    ocp.start(a, 1.0)
    ocp.start(b, 0.0)
    ocp.start(c, 0.0)
    return ocp


NODES, STEP, DIFFUSION, HEATING = 10, 0.1, 0.2, 20.0
"""temperatures along the bar, their distance, the bar's diffusion, and the strength of the heating"""


def _bar(name: str) -> tuple[OptimalControlProblem, ca.SX, ca.SX]:
    """Return a bar with its temperatures (10, 1) and its heating, to be brought to 0 from 1."""
    ocp = OptimalControlProblem(name)
    y = ocp.state("y", NODES, guess=1.0)
    u = ocp.control("u", lower=-1.0, upper=1.0, guess=1.0)
    ocp.duration(20.0)
    ocp.minimise(running=STEP * ca.sumsqr(y[: NODES - 1]) / 2)
    ocp.start(y, 1.0)
    return ocp, y, u


def heat_dirichlet() -> OptimalControlProblem:
    """A bar whose ends are held at 0, heated near one of them (Bocop: heat_dirichlet).

        minimise h/2 ∫_0^20 Σ_(i=1)^9 y_i^2 dt   subject to   y_i' = c (y_(i-1) - 2 y_i + y_(i+1)) / h^2 + 20 u δ_i1,
            y_0 = y_11 = 0,   |u| <= 1,   y(0) = 1,   h = 0.1,   c = 0.2,   i = 1 ... 10

    The file leaves the last temperature out of the sum. Singular but for the first moments.
    """
    ocp, y, u = _bar("heat, Dirichlet")
    padded = ca.vertcat(0.0, y, 0.0)
    ocp.dynamics(
        y, DIFFUSION * (padded[:-2] - 2 * y + padded[2:]) / STEP**2 + ca.vertcat(HEATING * u, ca.SX(NODES - 1, 1))
    )
    return ocp


def heat_neumann() -> OptimalControlProblem:
    """A bar that is heated through one end, the other insulated (Bocop: heat_neumann).

        minimise h/2 ∫_0^20 Σ_(i=1)^9 y_i^2 dt   subject to   y_i' = c (y_(i-1) - 2 y_i + y_(i+1)) / h^2 + 200 u δ_i1,
            y_0 = y_1,   y_11 = y_10,   |u| <= 1,   y(0) = 1,   h = 0.1,   c = 0.2,   i = 1 ... 10

    The file leaves the last temperature out of the sum. Singular but for the first moments.
    """
    ocp, y, u = _bar("heat, Neumann")
    padded = ca.vertcat(y[0], y, y[NODES - 1])
    flow = ca.vertcat(HEATING * u / STEP, ca.SX(NODES - 1, 1))
    ocp.dynamics(y, DIFFUSION * (padded[:-2] - 2 * y + padded[2:]) / STEP**2 + flow)
    return ocp
