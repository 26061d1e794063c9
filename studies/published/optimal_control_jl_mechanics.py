"""Problems of mechanics of OptimalControlProblems.jl (control-toolbox), as its ext/OptimalControlModels has them."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem


def double_oscillator() -> OptimalControlProblem:
    """Two coupled oscillators with a damper that is controlled (Coudurier, Lepreux and Petit, 2018).

        minimise 1/2 ∫_0^2π x1^2 + x2^2 + u^2 dt   subject to   x1' = x3,   x2' = x4,
            m1 x3' = -(k1 + k2) x1 + k2 x2 + sin t,   m2 x4' = k2 (x1 - x2) - c (1 - u) x4,   |u| <= 1

    with m1 = 100 kg, m2 = 2 kg, c = 0.5 N s/m, k1 = 100 N/m, k2 = 3 N/m; x1(0) = x2(0) = 0, and the speeds at the start
    are free, as double_oscillator.jl has them.
    """
    m1, m2, c, k1, k2 = 100.0, 2.0, 0.5, 100.0, 3.0  # [kg], [kg], [N s/m], [N/m], [N/m]
    ocp = OptimalControlProblem("double oscillator")

    x1 = ocp.state("x1")  # [m]
    x2 = ocp.state("x2")  # [m]
    x3 = ocp.state("x3")  # [m/s]
    x4 = ocp.state("x4")  # [m/s]
    u = ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(2.0 * math.pi)

    ocp.minimise(running=(x1**2 + x2**2 + u**2) / 2)

    ocp.dynamics(x1, x3)
    ocp.dynamics(x2, x4)
    ocp.dynamics(x3, (-(k1 + k2) * x1 + k2 * x2 + ca.sin(ocp.t)) / m1)
    ocp.dynamics(x4, (k2 * (x1 - x2) - c * (1 - u) * x4) / m2)

    ocp.start(x1, 0.0)
    ocp.start(x2, 0.0)
    return ocp


def dielectrophoretic_particle() -> OptimalControlProblem:
    """A particle moved by a dielectrophoretic force in the least time (Chang, Petit and Rouchon, 2006).

        minimise T   subject to   x' = y u + α u^2,   y' = -c y + u,   |u| <= 1,   (1, 0) to x(T) = 2

    with α = -0.75, c = 1 (dielectrophoretic_particle.jl).
    """
    ocp = OptimalControlProblem("dielectrophoretic particle")

    x = ocp.state("x", guess=1.0)
    y = ocp.state("y", guess=1.0)
    u = ocp.control("u", lower=-1.0, upper=1.0, guess=0.0)
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, y * u - 0.75 * u**2)
    ocp.dynamics(y, -y + u)

    ocp.start(x, 1.0)
    ocp.start(y, 0.0)
    ocp.end(x, 2.0)
    return ocp


def cart_pendulum() -> OptimalControlProblem:
    """A pendulum on a cart swung up in the least time, with the equations of cart_pendulum.jl.

        minimise T   subject to   x' = v,   v' = a',   θ' = ω,   ω' = α(a'),
            α(a) = -(m L / 2) (a cos θ + g sin θ) / (I + m L^2 / 4),
            a' = -(F - m A_x(a) - M a) / M + a,   A_x(a) = -L ω sin θ + (L / 2) cos θ α(a) + a,
            |x| <= 1,   |v| <= 2,   |F| <= 5,   (x, θ, ω)(0) = 0,   (θ, ω)(T) = (π, 0)

    with L = 1 m, m = 1 kg, I = m L^2 / 12, cart M = 0.5 kg, g = 9.81 m/s^2. In the benchmark of FATROP (Vanroye et al.,
    2023) a' solves the cart's balance of forces, whatever ``a`` is; here the Jacobian is M alone, the centripetal term
    has ω for ω^2, and ``a`` is a constant that the package leaves to the optimiser: no mechanics, but a problem.
    """
    g, L, m, M = 9.81, 1.0, 1.0, 0.5  # [m/s^2], [m], [kg], [kg]
    inertia = m * L**2 / 12
    ocp = OptimalControlProblem("cart pendulum")

    x = ocp.state("x", lower=-1.0, upper=1.0, guess=0.1)  # [m]
    v = ocp.state("v", lower=-2.0, upper=2.0, guess=0.1)  # [m/s]
    theta = ocp.state("theta", guess=0.1)  # [rad]
    omega = ocp.state("omega", guess=0.1)  # [rad/s]
    a = ocp.unknown("a", guess=0.1)  # [m/s^2]
    F = ocp.control("F", lower=-5.0, upper=5.0, guess=0.1)  # [N]
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(terminal=T)

    sin, cos = ca.sin(theta), ca.cos(theta)

    def alpha(cart: ca.SX) -> ca.SX:
        return -0.5 * L * m * (cart * cos + g * sin) / (inertia + 0.25 * m * L**2)

    imbalance = F - m * (-L * omega * sin + L / 2 * cos * alpha(a) + a) - M * a
    cart = -(imbalance - M * a) / M
    ocp.dynamics(x, v)
    ocp.dynamics(v, cart)
    ocp.dynamics(theta, omega)
    ocp.dynamics(omega, alpha(cart))

    for state in (x, theta, omega):
        ocp.start(state, 0.0)
    ocp.end(theta, math.pi)
    ocp.end(omega, 0.0)
    return ocp


def mountain_car() -> OptimalControlProblem:
    """A car too weak for the hill swings out of the valley in the least time (Moore, 1990; dymos).

        minimise T   subject to   x' = v,   v' = 0.001 u - 0.0025 cos 3 x,   |u| <= 1,   -1.2 <= x <= 0.5,
            |v| <= 0.07,   (-0.5, 0) to x(T) = 0.5, v(T) >= 0

    The control is bang-bang (mountain_car.jl).
    """
    ocp = OptimalControlProblem("mountain car")

    x = ocp.state("x", lower=-1.2, upper=0.5, guess=(-0.5, 0.5))
    v = ocp.state("v", lower=-0.07, upper=0.07)
    u = ocp.control("u", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=110.0, lower=0.1)

    ocp.minimise(terminal=T)

    ocp.dynamics(x, v)
    ocp.dynamics(v, 0.001 * u - 0.0025 * ca.cos(3 * x))

    ocp.start(x, -0.5)
    ocp.start(v, 0.0)
    ocp.end(x, 0.5)
    ocp.end_constraint(v >= 0.0)
    return ocp
