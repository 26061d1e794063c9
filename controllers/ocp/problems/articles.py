"""Problems of articles, or solved on paper."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def double_integrator_energy(end_at_rest: bool = True) -> ProblemFunctions:
    """The double integrator, x' = v, v' = u, with the least energy and in the least time: both are solved on paper.

    energy   1/2 ∫_0^1 u^2 dt from (0, 0) to x(1) = 1:   J* = 6 with v(1) = 0,   J* = 3/2 with v(1) free
    time     T from rest to rest over a distance of 3, |u| <= 1:   T* = 2 sqrt(3), u = 1 and then -1
    """
    ocp = OptimalControlProblem(f"double integrator, energy, v(T) {'fixed' if end_at_rest else 'free'}")

    x = ocp.state("x", guess=(0.0, 1.0))
    v = ocp.state("v", guess=(0.0, 1.0))
    u = ocp.control("u", scale=5.0)
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, 1.0)
    if end_at_rest:
        ocp.end(v, 0.0)
    return ocp.functions()


@cache
def double_integrator_time() -> ProblemFunctions:
    """Least time from rest to rest."""
    DISTANCE = 3.0
    ocp = OptimalControlProblem("double integrator, time")

    x = ocp.state("x", scale=DISTANCE, guess=(0.0, DISTANCE))
    v = ocp.state("v", scale=math.sqrt(DISTANCE), guess=(0.0, 1.0, 0.0))
    u = ocp.control("u", lower=-1.0, upper=1.0, guess=(1.0, -1.0))
    T = ocp.free_duration(guess=4.0, lower=0.5, upper=20.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, DISTANCE)
    ocp.end(v, 0.0)
    return ocp.functions()


@cache
def target_line() -> ProblemFunctions:
    """The double integrator driven onto a line with the least energy (Locatelli).

        minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   (0, 0) to x(1) - 2 v(1) = 1

    The costate at the end is normal to the line: u = -3/7 (1 + t), J* = 3/14 (Optimal Control of a Double Integrator).
    """
    ocp = OptimalControlProblem("target line")

    x = ocp.state("x")
    v = ocp.state("v")
    u = ocp.control("u")
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end_constraint(x - 2 * v, lower=1.0, upper=1.0)
    return ocp.functions()


@cache
def linear_hypersensitive() -> ProblemFunctions:
    """The linear hypersensitive problem: two boundary layers that a short horizon lets touch (Rao and Mease, 1999).

        minimise 1/2 ∫_0^10 x^2 + u^2 dt   subject to   x' = -x + u,   x(0) = 1.5,   x(10) = 1

    Linear and quadratic: x = A e^(√2 t) + B e^(-√2 t), J* = 1.67309398.
    """
    ocp = OptimalControlProblem("linear hypersensitive")

    x = ocp.state("x", guess=(1.5, 1.0))
    u = ocp.control("u")
    ocp.duration(10.0)

    ocp.minimise(running=(x**2 + u**2) / 2)

    ocp.dynamics(x, -x + u)

    ocp.start(x, 1.5)
    ocp.end(x, 1.0)
    return ocp.functions()


@cache
def van_der_pol_time() -> ProblemFunctions:
    """The van der Pol oscillator steered between two states in the least time (Maurer, Büskens, Kim and Kaya, 2005).

        minimise T   subject to   x1' = x2,   x2' = -x1 + x2 (1 - x1^2) + u,   |u| <= 1,   (-0.4, 0.6) to (0.6, 0.4)

    The control is bang-bang with one switch: T* = 1.2540747.
    """
    START, END = (-0.4, 0.6), (0.6, 0.4)
    ocp = OptimalControlProblem("van der Pol, time")

    x1 = ocp.state("x1", guess=(START[0], END[0]))
    x2 = ocp.state("x2", guess=(START[1], END[1]))
    u = ocp.control("u", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=1.0, lower=0.1, upper=10.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x1 + x2 * (1 - x1**2) + u)

    for state, start, end in zip((x1, x2), START, END, strict=True):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()


@cache
def singular_regulator() -> ProblemFunctions:
    """A double integrator regulated without a price on the control (Bell and Jacobson, 1975; Fraser-Andrews, 1996).

        minimise ∫_0^5 x^2 + v^2 dt   subject to   x' = v,   v' = u,   |u| <= 1,   (x, v)(0) = (0, 1)

    The optimum brakes with all it has and then follows the singular control u = x: J* = 0.75398386.
    """
    ocp = OptimalControlProblem("singular regulator")

    x = ocp.state("x")
    v = ocp.state("v", guess=(1.0, 0.0))
    u = ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(5.0)

    ocp.minimise(running=x**2 + v**2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u)

    ocp.start(x, 0.0)
    ocp.start(v, 1.0)
    return ocp.functions()


@cache
def fishing() -> ProblemFunctions:
    """Fishing that brings prey and predator to rest: Lotka and Volterra's equations, relaxed (Sager, 2006; mintoc.de).

        minimise ∫_0^12 (x1 - 1)^2 + (x2 - 1)^2 dt   subject to   x1' = x1 - x1 x2 - 0.4 x1 u,
            x2' = -x2 + x1 x2 - 0.2 x2 u,   0 <= u <= 1,   x(0) = (0.5, 0.7)

    No fishing, all of it, a singular arc, and none at the end: J* = 1.3440812.
    """
    ocp = OptimalControlProblem("fishing")

    x1 = ocp.state("x1", lower=0.0, guess=(0.5, 1.0))
    x2 = ocp.state("x2", lower=0.0, guess=(0.7, 1.0))
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.duration(12.0)

    ocp.minimise(running=(x1 - 1) ** 2 + (x2 - 1) ** 2)

    ocp.dynamics(x1, x1 - x1 * x2 - 0.4 * x1 * u)
    ocp.dynamics(x2, -x2 + x1 * x2 - 0.2 * x2 * u)

    ocp.start(x1, 0.5)
    ocp.start(x2, 0.7)
    return ocp.functions()


@cache
def stirred_tank() -> ProblemFunctions:
    """A stirred-tank reactor brought back to its unstable rest (Lapidus and Luus, 1967; Luus and Cormack, 1972).

        minimise ∫_0^0.78 x1^2 + x2^2 + 0.1 u^2 dt   subject to   x1' = -2 (x1 + 0.25) + r - u (x1 + 0.25),
            x2' = 0.5 - x2 - r,   r = (x2 + 0.5) exp(25 x1 / (x1 + 2)),   x(0) = (0.09, 0.09)

    x1 and x2 are the deviations of temperature and concentration. There are two local optima: J* = 0.13309573
    and 0.2444.
    """
    ocp = OptimalControlProblem("stirred tank")

    x1 = ocp.state("x1", lower=-0.5, upper=1.0, scale=0.1, guess=(0.09, 0.0))
    x2 = ocp.state("x2", lower=-0.5, upper=1.0, scale=0.1, guess=(0.09, 0.0))
    u = ocp.control("u", guess=(2.5, 2.5))
    ocp.duration(0.78)

    ocp.minimise(running=x1**2 + x2**2 + 0.1 * u**2)

    reaction = (x2 + 0.5) * ca.exp(25 * x1 / (x1 + 2))
    ocp.dynamics(x1, -2 * (x1 + 0.25) + reaction - u * (x1 + 0.25))
    ocp.dynamics(x2, 0.5 - x2 - reaction)

    ocp.start(x1, 0.09)
    ocp.start(x2, 0.09)
    return ocp.functions()


CART_MASS, POLE_MASS, POLE_LENGTH, GRAVITY = 1.0, 0.3, 0.5, 9.81  # [kg], [kg], [m], [m/s^2]


@cache
def cart_pole() -> ProblemFunctions:
    """The cart-pole swing-up with the least force squared (Kelly, SIAM Review 59, 2017).

        minimise ∫_0^2 F^2 dt   subject to   |F| <= 20,   (q, φ, q', φ') = (0, 0, 0, 0) to (1, π, 0, 0)
        (M + m) q'' + m L (φ'' cos φ - φ'^2 sin φ) = F,        L φ'' + q'' cos φ + g sin φ = 0

    with cart M = 1 kg, pole m = 0.3 kg, L = 0.5 m, g = 9.81 m/s^2; φ = 0 hangs. J* = 57.944780, with a push away from
    the target first. A straight guess, as in the article, leads to a push towards it: a local minimum of 58.807667.
    """
    M, m, L, g = CART_MASS, POLE_MASS, POLE_LENGTH, GRAVITY
    ocp = OptimalControlProblem("cart-pole")

    q = ocp.state("q")  # [m]
    phi = ocp.state("phi", scale=math.pi)  # [rad]
    dq = ocp.state("dq", scale=2.0)  # [m/s]
    dphi = ocp.state("dphi", scale=5.0)  # [rad/s]
    F = ocp.control("F", lower=-20.0, upper=20.0, scale=10.0)  # [N]
    ocp.duration(2.0)

    ocp.minimise(running=F**2)

    sin, cos = ca.sin(phi), ca.cos(phi)
    inertia = M + m * sin**2
    ocp.dynamics(q, dq)
    ocp.dynamics(phi, dphi)
    ocp.dynamics(dq, (F + m * sin * (L * dphi**2 + g * cos)) / inertia)
    ocp.dynamics(dphi, -(F * cos + m * L * dphi**2 * sin * cos + (M + m) * g * sin) / (L * inertia))

    for state in (q, phi, dq, dphi):
        ocp.start(state, 0.0)
    for state, value in ((q, 1.0), (phi, math.pi), (dq, 0.0), (dphi, 0.0)):
        ocp.end(state, value)
    return ocp.functions()
