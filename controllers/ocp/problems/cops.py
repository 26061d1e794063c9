"""Problems of COPS 3, the constrained optimisation problem set (Dolan, Moré and Munson, 2004)."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def goddard() -> ProblemFunctions:
    """Goddard's rocket: the greatest height for a given amount of fuel, against drag and gravity (COPS 3, problem 10).

        maximise h(T)   subject to   h' = v,   v' = (F - D(h, v)) / m - 1 / h^2,   m' = -2 F,
                                     D = 310 v^2 exp(-500 (h - 1)),   0 <= F <= 3.5,   (1, 0, 1) to m = 0.6,   T free

    In units of the planet's radius, its gravity and the take-off mass. The optimum climbs at full thrust until
    m / h^2 = D (1 + 2 v), stays on this singular arc until the fuel is spent, and coasts: h(T)* = 1.0128369. COPS
    prints 1.01283. The often seen 1.0128436 comes from a coarse collocation, which overestimates; no control reaches
    it.
    """
    ocp = OptimalControlProblem("Goddard")

    h = ocp.state("h", lower=1.0, scale=0.01, guess=(1.0, 1.01))
    v = ocp.state("v", lower=0.0, scale=0.1, guess=(0.0, 0.1, 0.0))
    m = ocp.state("m", lower=0.6, upper=1.0, guess=(1.0, 0.6))
    F = ocp.control("F", lower=0.0, upper=3.5, scale=3.5, guess=(3.5, 0.0))
    ocp.free_duration(guess=0.2, lower=0.05, upper=1.0)

    ocp.minimise(terminal=-h)

    ocp.dynamics(h, v)
    ocp.dynamics(v, (F - 310 * v**2 * ca.exp(-500 * (h - 1))) / m - 1 / h**2)
    ocp.dynamics(m, -2 * F)

    ocp.start(h, 1.0)
    ocp.start(v, 0.0)
    ocp.start(m, 1.0)
    ocp.end(m, 0.6)
    return ocp.functions()


@cache
def catalyst_mixing() -> ProblemFunctions:
    """Two catalysts mixed along a reactor so that it yields the most (Gunn and Thomas, 1965; COPS 3).

        minimise x1(1) + x2(1) - 1   subject to   x1' = u (10 x2 - x1),   x2' = u (x1 - 10 x2) - (1 - u) x2,
                                                  0 <= u <= 1,   x(0) = (1, 0)

    u is the fraction of the first catalyst: all of it, a singular arc, none of it. J* = -0.04805568.
    """
    ocp = OptimalControlProblem("catalyst mixing")

    x1 = ocp.state("x1", guess=(1.0, 1.0))
    x2 = ocp.state("x2", scale=0.1)
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.duration(1.0)

    ocp.minimise(terminal=x1 + x2 - 1)

    ocp.dynamics(x1, u * (10 * x2 - x1))
    ocp.dynamics(x2, u * (x1 - 10 * x2) - (1 - u) * x2)

    ocp.start(x1, 1.0)
    ocp.start(x2, 0.0)
    return ocp.functions()


@cache
def robot_arm() -> ProblemFunctions:
    """A robot arm turned in the least time: a bar that slides and swings on two axes (Moessner-Beigel 1999; COPS 3).

        minimise T   subject to   ρ'' = u1 / L,   θ'' = u2 / I_θ,   φ'' = u3 / I_φ,   |u| <= 1,
            I_φ = ((L - ρ)^3 + ρ^3) / 3,   I_θ = I_φ sin^2 φ,   L = 5,   (4.5, 0, π/4) to (4.5, 2π/3, π/4), rest to rest

    All three controls are bang-bang: T* = 9.1409117. 9.140936 and 9.140963 are often seen, of grids too coarse.
    """
    LENGTH, TURN = 5.0, 2.0 * math.pi / 3.0
    L = LENGTH
    ocp = OptimalControlProblem("robot arm")

    rho = ocp.state("rho", lower=0.0, upper=L, guess=(4.5, 4.5))
    theta = ocp.state("theta", lower=-math.pi, upper=math.pi, guess=(0.0, TURN))  # [rad]
    phi = ocp.state("phi", lower=0.0, upper=math.pi, guess=(math.pi / 4, math.pi / 4))  # [rad]
    drho = ocp.state("drho")
    dtheta = ocp.state("dtheta")
    dphi = ocp.state("dphi")
    u1, u2, u3 = (ocp.control(f"u{k}", lower=-1.0, upper=1.0) for k in (1, 2, 3))
    T = ocp.free_duration(guess=9.0, lower=0.1, upper=100.0)

    ocp.minimise(terminal=T)

    I_phi = ((L - rho) ** 3 + rho**3) / 3
    ocp.dynamics(rho, drho)
    ocp.dynamics(theta, dtheta)
    ocp.dynamics(phi, dphi)
    ocp.dynamics(drho, u1 / L)
    ocp.dynamics(dtheta, u2 / (I_phi * ca.sin(phi) ** 2))
    ocp.dynamics(dphi, u3 / I_phi)

    for state, start, end in ((rho, 4.5, 4.5), (theta, 0.0, TURN), (phi, math.pi / 4, math.pi / 4)):
        ocp.start(state, start)
        ocp.end(state, end)
    for state in (drho, dtheta, dphi):
        ocp.start(state, 0.0)
        ocp.end(state, 0.0)
    return ocp.functions()


@cache
def hanging_chain() -> ProblemFunctions:
    """The chain that hangs between two points with the least potential energy (Johann Bernoulli 1691; COPS 3).

        minimise ∫_0^1 x sqrt(1 + u^2) dt   subject to   x' = u,   l' = sqrt(1 + u^2),   (1, 0) to (3, 4)

    An integral is given, the length 4: the optimum is a catenary, J* = 5.0684801.

    On given nodes, Hermite-Simpson's programme has minima below J*: in some interval the chain hangs straight down, and
    Simpson's three points miss what it measures there. In which interval, and whether a solve ends at all, hangs on the
    last digits of the start. The replay refuses each of them; ``solve()`` without nodes finds the catenary.
    """
    LENGTH, START, END = 4.0, 1.0, 3.0
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


@cache
def hang_glider() -> ProblemFunctions:
    """A hang glider that crosses a thermal and flies as far as it can (Bulirsch, Nerz, Pesch, von Stryk, 1993; COPS 3).

        maximise x(T)   subject to   x' = v_x,   v_x' = -(L sin η + D cos η) / m,
                                     y' = v_y,   v_y' = (L cos η - D sin η) / m - g,   0 <= c <= 1.4,
            X = (x / 100 - 2.5)^2,   updraft w = 2.5 (1 - X) e^(-X),   V = v_y - w,
            v^2 = v_x^2 + V^2,   sin η = V / v,
            L = c ρ S v^2 / 2,   D = (0.034 + 0.069662 c^2) ρ S v^2 / 2,   ρ = 1.13, S = 14, m = 100, g = 9.80665,
            (x, y) = (0, 1000) to y = 900, (v_x, v_y) = (13.2275675, -1.28750052) at either end

    c is the lift coefficient: x(T)* = 1248.031 m.
    """
    MASS, GRAVITY, AREA, DENSITY = 100.0, 9.80665, 14.0, 1.13  # [kg], [m/s^2], [m^2], [kg/m^3]
    DRAG, INDUCED_DRAG = 0.034, 0.069662
    UPDRAFT, RADIUS = 2.5, 100.0  # [m/s], [m]
    GLIDE = (13.2275675, -1.28750052)  # [m/s] v_x, v_y
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
