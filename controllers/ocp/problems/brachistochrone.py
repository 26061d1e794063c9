"""The brachistochrone: the wire on which a bead slides from rest in the least time (Johann Bernoulli, 1696).

    minimise T   subject to   x' = v sin θ,   y' = v cos θ,   v' = g cos θ,   0 <= θ <= 2π

with y downwards, θ from the vertical. ``brachistochrone`` slides from (0, 0) to (2, 2): T* = 0.8247591 for g = 9.8
(manual of PSOPT), 0.8243387 for g = 9.81 (manual of GPOPS-II). ``brachistochrone_drop`` has y upwards, slides from
(0, 10) to (10, 5) with g = 9.80665 and takes T* = 1.8016031 (documentation of dymos).
"""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def brachistochrone(gravity: float = 9.8) -> ProblemFunctions:
    """Fastest slide from (0, 0) to (2, 2), y downwards."""
    return _slide(f"brachistochrone, g = {gravity:g}", (0.0, 0.0), (2.0, 2.0), gravity, downwards=1.0)


@cache
def brachistochrone_drop() -> ProblemFunctions:
    """Fastest slide from (0, 10) to (10, 5), y upwards."""
    return _slide("brachistochrone, drop", (0.0, 10.0), (10.0, 5.0), 9.80665, downwards=-1.0)


def _slide(
    name: str, start: tuple[float, float], end: tuple[float, float], g: float, downwards: float
) -> ProblemFunctions:
    drop = abs(end[1] - start[1])
    speed = math.sqrt(2.0 * g * drop)
    ocp = OptimalControlProblem(name)

    x = ocp.state("x", scale=drop, guess=(start[0], end[0]))  # [m]
    y = ocp.state("y", scale=drop, guess=(start[1], end[1]))  # [m]
    v = ocp.state("v", scale=speed, guess=(0.0, speed))  # [m/s]
    theta = ocp.control("theta", lower=0.0, upper=2.0 * math.pi, guess=(0.5, 1.5))  # [rad]
    T = ocp.free_duration(guess=2.0 * math.dist(start, end) / speed, lower=0.1, upper=10.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, v * ca.sin(theta))
    ocp.dynamics(y, downwards * v * ca.cos(theta))
    ocp.dynamics(v, g * ca.cos(theta))

    for state, value in ((x, start[0]), (y, start[1]), (v, 0.0)):
        ocp.start(state, value)
    for state, value in ((x, end[0]), (y, end[1])):
        ocp.end(state, value)
    return ocp.functions()
