"""Bocop's mechanical examples: a beam, integrators, regulators, an oscillator and a rocket.

Limits, constants and starting values are those of each ``problem.def``; Bocop starts at 0.1 what a file does not name.
"""

from __future__ import annotations

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem

INIT = 0.1
"""Bocop's starting value of every variable for which its file has none"""


def beam() -> OptimalControlProblem:
    """A clamped beam that must not bend further than a limit (Bocop: beam).

        minimise ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   0 <= x <= 0.1,   |u| <= 10,   (0, 1) to (0, -1)

    Twice the Bryson-Denham problem of L = 0.1: J* = 8 / (9 L).
    """
    ocp = OptimalControlProblem("beam")
    x = ocp.state("x", lower=0.0, upper=0.1, guess=INIT)
    v = ocp.state("v", guess=INIT)
    u = ocp.control("u", lower=-10.0, upper=10.0, guess=INIT)
    ocp.duration(1.0)

    ocp.minimise(running=u**2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    ocp.end(x, 0.0)
    ocp.end(v, -1.0)
    return ocp


def fuller() -> OptimalControlProblem:
    """Fuller's problem: the control switches infinitely often in finite time (Bocop: fuller).

        minimise ∫_0^3.5 x^2 dt   subject to   x' = v,   v' = u,   |u| <= 1,   (0, 1) to (0, 0)

    Each switch is at x = -ζ v |v| with ζ^2 = (√33 - 1) / 24, from t = 2.92 on x rests at 0: J* = 0.26839383.
    """
    ocp = OptimalControlProblem("Fuller")
    x, v = ocp.state("x", guess=INIT), ocp.state("v", guess=INIT)
    u = ocp.control("u", lower=-1.0, upper=1.0, guess=INIT)
    ocp.duration(3.5)

    ocp.minimise(running=x**2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    ocp.end(x, 0.0)
    ocp.end(v, 0.0)
    return ocp


def integrator_1d() -> OptimalControlProblem:
    """An integrator that meets a target which moves away, at the least energy (Bocop: integrator_1D).

        minimise ∫_0^T u^2 dt   subject to   x' = u,   x(0) = 0,   x(T) = 2 T + 10,   0.1 <= T <= 100

    u = (2 T + 10) / T, so J = (2 T + 10)^2 / T: T* = 5, J* = 80.
    """
    ocp = OptimalControlProblem("integrator 1D")
    x, u = ocp.state("x", guess=INIT), ocp.control("u", guess=INIT)
    T = ocp.free_duration(guess=INIT, lower=0.1, upper=100.0)

    ocp.minimise(running=u**2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end_constraint(x == 2 * T + 10)
    return ocp


def integrator_2d() -> OptimalControlProblem:
    """The double integrator, from rest to rest at the least energy (Bocop: integrator_2D).

        minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   (-1, 0) to (0, 0)

    J* = 6.
    """
    ocp = OptimalControlProblem("integrator 2D")
    x, v, u = ocp.state("x", guess=INIT), ocp.state("v", guess=INIT), ocp.control("u", guess=INIT)
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, -1.0)
    ocp.start(v, 0.0)
    ocp.end(x, 0.0)
    ocp.end(v, 0.0)
    return ocp


def regulator_1d() -> OptimalControlProblem:
    """An integrator that is held near 0 between two values, singular in the middle (Bocop: regulator_1D).

        minimise ∫_0^2 x^2 dt   subject to   x' = u,   |u| <= 1,   x from 1 to 0.5

    u = -1 to t = 1, 0, and 1 from t = 1.5: J* = 1/3 + 1/24.
    """
    ocp = OptimalControlProblem("regulator 1D")
    x, u = ocp.state("x", guess=INIT), ocp.control("u", lower=-1.0, upper=1.0, guess=INIT)
    ocp.duration(2.0)

    ocp.minimise(running=x**2)
    ocp.dynamics(x, u)
    ocp.start(x, 1.0)
    ocp.end(x, 0.5)
    return ocp


def regulator_2d() -> OptimalControlProblem:
    """The singular regulator (Bocop: regulator_2D).

        minimise 1/2 ∫_0^5 (x^2 + v^2) dt   subject to   x' = v,   v' = u,   |u| <= 1,   (0, 1) to anywhere

    u = -1 to t = 1.41, then u = x, on which x^2 - v^2 is constant: J* = 0.37699193.
    """
    ocp = OptimalControlProblem("regulator 2D")
    x, v = ocp.state("x", guess=INIT), ocp.state("v", guess=INIT)
    u = ocp.control("u", lower=-1.0, upper=1.0, guess=INIT)
    ocp.duration(5.0)

    ocp.minimise(running=(x**2 + v**2) / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    return ocp


def robbins() -> OptimalControlProblem:
    """Robbins' problem: a state limit of third order, touched infinitely often (Bocop: robbins).

    minimise ∫_0^10 (3 x + u^2 / 2) dt   subject to   x''' = u,   x >= 0,   (1, -2, 0) to (0, 0, 0)

    Between touch points x is a polynomial of degree six, from t = 5.8 on it rests at 0: J* = 19.431782."""
    ocp = OptimalControlProblem("Robbins")
    x, dx, ddx = ocp.state("x", lower=0.0, guess=INIT), ocp.state("dx", guess=INIT), ocp.state("ddx", guess=INIT)
    u = ocp.control("u", guess=INIT)
    ocp.duration(10.0)

    ocp.minimise(running=3 * x + u**2 / 2)
    ocp.dynamics(x, dx)
    ocp.dynamics(dx, ddx)
    ocp.dynamics(ddx, u)
    for state, value in ((x, 1.0), (dx, -2.0), (ddx, 0.0)):
        ocp.start(state, value)
        ocp.end(state, 0.0)
    return ocp


def vanderpol() -> OptimalControlProblem:
    """Van der Pol's oscillator, damped by a force (Bocop: vanderpol).

    minimise 1/2 ∫_0^2 (x^2 + v^2 + u^2) dt   subject to   x' = v,   v' = (1 - x^2) v - x + u,   (1, 0) to anywhere
    """
    ocp = OptimalControlProblem("van der Pol")
    x, v, u = ocp.state("x", guess=INIT), ocp.state("v", guess=INIT), ocp.control("u", guess=INIT)
    ocp.duration(2.0)

    ocp.minimise(running=(x**2 + v**2 + u**2) / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, (1 - x**2) * v - x + u)
    ocp.start(x, 1.0)
    ocp.start(v, 0.0)
    return ocp


def goddard() -> OptimalControlProblem:
    """Goddard's rocket to a height with the most mass, its drag limited (Bocop: goddard).

        maximise m(T)   subject to   r' = v,   v' = (3.5 u - D) / m - 1 / r^2,   m' = -7 u,
            D = 310 v^2 exp(-500 (r - 1)) <= 0.4,   0 <= u <= 1,   r >= 1,   v, m >= 0,
            (1, 0, 1) to r >= 1.01,   T >= 0.001

    In units of the planet's radius, its gravity and the mass at take-off. Full thrust, the limit of the drag, and a
    coast: m(T)* = 0.62973890.
    """
    ocp = OptimalControlProblem("Goddard, drag limited")
    r = ocp.state("r", lower=1.0, guess=(1.0, 1.5, 1.0))
    v = ocp.state("v", lower=0.0, guess=INIT)
    m = ocp.state("m", lower=0.0, guess=INIT)
    u = ocp.control("u", lower=0.0, upper=1.0, guess=(1.0, 0.6, 0.0))
    ocp.free_duration(guess=0.1, lower=0.001)

    ocp.minimise(terminal=-m)
    drag = 310 * v**2 * ca.exp(-500 * (r - 1))
    ocp.dynamics(r, v)
    ocp.dynamics(v, (3.5 * u - drag) / m - 1 / r**2)
    ocp.dynamics(m, -7 * u)
    ocp.constrain(drag <= 0.4, name="drag")
    ocp.start(r, 1.0)
    ocp.start(v, 0.0)
    ocp.start(m, 1.0)
    ocp.end_constraint(r >= 1.01)
    return ocp
