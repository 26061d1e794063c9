"""Problems of Bryson's books: Applied Optimal Control (Bryson and Ho, 1975) and Dynamic Optimization (Bryson, 1999)."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

WALL = 1.0 / 9.0


@cache
def bryson_denham(wall: float = WALL) -> ProblemFunctions:
    """Bryson-Denham: turn a body around before a wall with the least energy (Bryson and Ho, Applied Optimal Control).

        minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   x <= L,   (0, 1) to (0, -1)

    For L <= 1/6 the optimum J* = 4 / (9 L) rests on the wall between t = 3 L and 1 - 3 L: 4 for L = 1/9,
    40/9 for L = 0.1.
    """
    ocp = OptimalControlProblem(f"Bryson-Denham, L = {wall:.4g}")

    x = ocp.state("x", upper=wall, scale=0.1, guess=(0.0, 0.1, 0.0))
    v = ocp.state("v", guess=(1.0, -1.0))
    u = ocp.control("u", scale=5.0)
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    ocp.end(x, 0.0)
    ocp.end(v, -1.0)
    return ocp.functions()


@cache
def steering() -> ProblemFunctions:
    """A particle of constant thrust, steered to a height and a speed in the least time (Bryson and Ho, 2.4; COPS 3).

        minimise T   subject to   x'' = a cos θ,   y'' = a sin θ,   |θ| <= π/2,   a = 100,
                                  rest at 0 to y = 5, x' = 45, y' = 0

    The optimum follows the linear tangent law tan θ = c (1 - 2 t / T): T* = 0.55457088.
    """
    THRUST, HEIGHT, SPEED = 100.0, 5.0, 45.0
    ocp = OptimalControlProblem("steering")

    x = ocp.state("x", scale=10.0)
    y = ocp.state("y", scale=5.0, guess=(0.0, HEIGHT))
    dx = ocp.state("dx", scale=45.0, guess=(0.0, SPEED))
    dy = ocp.state("dy", scale=45.0)
    theta = ocp.control("theta", lower=-math.pi / 2, upper=math.pi / 2)  # [rad]
    T = ocp.free_duration(guess=1.0, lower=0.1, upper=10.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, dx)
    ocp.dynamics(y, dy)
    ocp.dynamics(dx, THRUST * ca.cos(theta))
    ocp.dynamics(dy, THRUST * ca.sin(theta))

    for state in (x, y, dx, dy):
        ocp.start(state, 0.0)
    for state, value in ((y, HEIGHT), (dx, SPEED), (dy, 0.0)):
        ocp.end(state, value)
    return ocp.functions()


@cache
def zermelo() -> ProblemFunctions:
    """Zermelo's problem: the fastest crossing of a current that grows with distance (Zermelo 1931; Bryson and Ho, 2.7).

        minimise T   subject to   x' = cos θ - y,   y' = sin θ,   (3.66, -1.86) to (0, 0)

    in units of the ship's speed. The heading obeys θ' = cos^2 θ, tan θ is linear in t: T* = 5.4578653.
    """
    START = (3.66, -1.86)
    ocp = OptimalControlProblem("Zermelo")

    x = ocp.state("x", scale=3.0, guess=(START[0], 0.0))
    y = ocp.state("y", scale=3.0, guess=(START[1], 0.0))
    theta = ocp.control("theta", guess=(math.pi, math.pi))  # [rad]
    T = ocp.free_duration(guess=math.hypot(*START), lower=0.1, upper=100.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, ca.cos(theta) - y)
    ocp.dynamics(y, ca.sin(theta))

    for state, start in ((x, START[0]), (y, START[1])):
        ocp.start(state, start)
        ocp.end(state, 0.0)
    return ocp.functions()


@cache
def orbit_raising() -> ProblemFunctions:
    """Orbit raising: the largest circle that a small constant thrust reaches in a given time (Bryson and Ho, 2.5).

        maximise r(T)   subject to   r' = w,   w' = v^2 / r - 1 / r^2 + F sin φ / m(t),
                                     v' = -w v / r + F cos φ / m(t),
                                     m(t) = 1 - 0.0749 t,   F = 0.1405,   T = 3.32,   (1, 0, 1) to w = 0, v = 1 / √r

    in units of the first orbit's radius and speed: w the radial, v the tangential speed, φ the thrust's angle above the
    local horizon. The thrust points outwards for half of the time and inwards for the other, and swings over quickly in
    between: r(T)* = 1.5252777.
    """
    THRUST, FUEL_FLOW, DURATION = 0.1405, 0.0749, 3.32
    ocp = OptimalControlProblem("orbit raising")

    r = ocp.state("r", lower=0.5, upper=5.0, guess=(1.0, 1.5))
    w = ocp.state("w", lower=-10.0, upper=10.0, guess=(0.0, 0.0))
    v = ocp.state("v", lower=-10.0, upper=10.0, guess=(1.0, 0.8))
    phi = ocp.control("phi", guess=(0.0, 2.0 * math.pi))  # [rad]
    ocp.duration(DURATION)

    ocp.minimise(terminal=-r)

    acceleration = THRUST / (1 - FUEL_FLOW * ocp.t)
    ocp.dynamics(r, w)
    ocp.dynamics(w, v**2 / r - 1 / r**2 + acceleration * ca.sin(phi))
    ocp.dynamics(v, -w * v / r + acceleration * ca.cos(phi))

    for state, value in ((r, 1.0), (w, 0.0), (v, 1.0)):
        ocp.start(state, value)
    ocp.end(w, 0.0)
    ocp.end_constraint(v - 1 / ca.sqrt(r))
    return ocp.functions()


@cache
def maximum_range() -> ProblemFunctions:
    """Bryson's maximum range: a body of constant thrust flies as far as it can in a given time (Bryson, 1999; PSOPT).

        maximise x(2)   subject to   x' = v cos θ,   y' = v sin θ,   v' = a - g sin θ,   a = g / 2,   g = 1,
                                     rest at 0 to y(2) = 0.1

    x(2)* = 1.7123149.
    """
    GRAVITY, ACCELERATION = 1.0, 0.5
    ocp = OptimalControlProblem("maximum range")

    x = ocp.state("x", guess=(0.0, 1.0))
    y = ocp.state("y", guess=(0.0, 0.1))
    v = ocp.state("v", guess=(0.0, 1.0))
    theta = ocp.control("theta", guess=(0.0, 0.0))  # [rad]
    ocp.duration(2.0)

    ocp.minimise(terminal=-x)

    ocp.dynamics(x, v * ca.cos(theta))
    ocp.dynamics(y, v * ca.sin(theta))
    ocp.dynamics(v, ACCELERATION - GRAVITY * ca.sin(theta))

    for state in (x, y, v):
        ocp.start(state, 0.0)
    ocp.end(y, 0.1)
    return ocp.functions()
