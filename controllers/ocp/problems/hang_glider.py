"""A hang glider that crosses a thermal and flies as far as it can (Bulirsch, Nerz, Pesch and von Stryk, 1993; COPS 3).

    maximise x(T)   subject to   x' = v_x,   v_x' = -(L sin η + D cos η) / m,
                                 y' = v_y,   v_y' = (L cos η - D sin η) / m - g,   0 <= c <= 1.4,
        X = (x / 100 - 2.5)^2,   updraft w = 2.5 (1 - X) e^(-X),   V = v_y - w,   v^2 = v_x^2 + V^2,   sin η = V / v,
        L = c ρ S v^2 / 2,   D = (0.034 + 0.069662 c^2) ρ S v^2 / 2,   ρ = 1.13, S = 14, m = 100, g = 9.80665,
        (x, y) = (0, 1000) to y = 900, (v_x, v_y) = (13.2275675, -1.28750052) at either end

c is the lift coefficient: x(T)* = 1248.031 m.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

MASS, GRAVITY, AREA, DENSITY = 100.0, 9.80665, 14.0, 1.13  # [kg], [m/s^2], [m^2], [kg/m^3]
DRAG, INDUCED_DRAG = 0.034, 0.069662
UPDRAFT, RADIUS = 2.5, 100.0  # [m/s], [m]
GLIDE = (13.2275675, -1.28750052)  # [m/s] v_x, v_y


@cache
def hang_glider() -> ProblemFunctions:
    """Farthest flight from 1000 m to 900 m through a thermal."""
    ocp = OptimalControlProblem("hang glider")

    x = ocp.state("x", lower=0.0, scale=1000.0, guess=(0.0, 1250.0))  # [m]
    y = ocp.state("y", lower=0.0, scale=100.0, guess=(1000.0, 900.0))  # [m]
    v_x = ocp.state("v_x", lower=0.0, scale=10.0, guess=(GLIDE[0], GLIDE[0]))  # [m/s]
    v_y = ocp.state("v_y", scale=1.0, guess=(GLIDE[1], GLIDE[1]))  # [m/s]
    c = ocp.control("c", lower=0.0, upper=1.4, guess=(0.7, 0.7))
    ocp.free_duration(guess=105.0, lower=10.0, upper=200.0)

    ocp.minimise(terminal=-x)

    X = (x / RADIUS - 2.5) ** 2
    V = v_y - UPDRAFT * (1 - X) * ca.exp(-X)
    v = ca.sqrt(v_x**2 + V**2)
    lift = c * DENSITY * AREA * v**2 / 2
    drag = (DRAG + INDUCED_DRAG * c**2) * DENSITY * AREA * v**2 / 2
    ocp.dynamics(x, v_x)
    ocp.dynamics(y, v_y)
    ocp.dynamics(v_x, -(lift * V + drag * v_x) / (v * MASS))
    ocp.dynamics(v_y, (lift * v_x - drag * V) / (v * MASS) - GRAVITY)

    for state, start in ((x, 0.0), (y, 1000.0), (v_x, GLIDE[0]), (v_y, GLIDE[1])):
        ocp.start(state, start)
    for state, end in ((y, 900.0), (v_x, GLIDE[0]), (v_y, GLIDE[1])):
        ocp.end(state, end)
    return ocp.functions()
