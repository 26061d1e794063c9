"""Problems of chemistry, biology and economics of OptimalControlProblems.jl (control-toolbox)."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem


def bioreactor() -> OptimalControlProblem:
    """Algae that grow by day feed a digester: the most methane in 20 days (Bayen, Mairet, Martinon and Sebbah, 2014).

        maximise 1/3 ∫_0^200 μ2 b dt   subject to   y' = μ y / (1 + y) - (r + u) y,   s' = -μ2 b + u (y - s),
            b' = (μ2 - u) b,   μ = max(0, sin (2π t / 10))^2,   μ2 = 0.1 s / (0.05 + s),   r = 0.005,
            0 <= u <= 1,   y, s >= 0,   b >= 0.001,   0.05 <= y(0) <= 0.25,   0.5 <= s(0) <= 5,   0.5 <= b(0) <= 3

    y, s and b are the algae, the substrate and the bacteria, u is the flow; a day lasts 10 (bioreactor.jl, from Bocop,
    where the horizon is 30 days).
    """
    ocp = OptimalControlProblem("bioreactor, 20 days")

    y = ocp.state("y", lower=0.0, guess=50.0)
    s = ocp.state("s", lower=0.0, guess=50.0)
    b = ocp.state("b", lower=0.001, guess=50.0)
    u = ocp.control("u", lower=0.0, upper=1.0, guess=0.5)
    ocp.duration(200.0)

    light = ca.fmax(0, ca.sin(2 * math.pi * ocp.t / 10)) ** 2
    growth = 0.1 * s / (0.05 + s)
    ocp.minimise(running=-growth * b / 3)

    ocp.dynamics(y, light * y / (1 + y) - (0.005 + u) * y)
    ocp.dynamics(s, -growth * b + u * (y - s))
    ocp.dynamics(b, (growth - u) * b)

    ocp.start_constraint(y, lower=0.05, upper=0.25)
    ocp.start_constraint(s, lower=0.5, upper=5.0)
    ocp.start_constraint(b, lower=0.5, upper=3.0)
    return ocp


def insurance() -> OptimalControlProblem:
    """A health insurance whose reimbursement follows the expense: the greatest utility of those insured.

        maximise ∫_0^10 U f dt   subject to   I' = (1 - γ t v'(m) / U_R) h,   m' = h,   P = ∫_0^10 I f dt,
            f = λ e^(-λ t) + e^(-10 λ) / 10,   v = m^2 / (1 + m^2),   v' = 2 m / (1 + m^2)^2,
            R = 1 - P + I - m,   H = 1.5 - γ t (1 - v),   U = 1 - e^(-10 R) + H,   U_R = 10 e^(-10 R),
            0 <= I, m <= 1.5,   0 <= h <= 25,   R, H, U >= 0,   U_R >= 0.001,   (I, m)(0) = (0, 0.001)

    t is how ill someone is, with the density f; m is the expense, I what the insurance pays, P its premium, R the
    revenue that is left and H the health; γ = 0.2, λ = 0.25 (insurance.jl, from Bocop; R, H, U and U_R are controls
    with path equations there).
    """
    gamma, rate, T = 0.2, 0.25, 10.0
    ocp = OptimalControlProblem("insurance")

    I = ocp.state("I", lower=0.0, upper=1.5)  # noqa: E741 - the symbol of the source
    m = ocp.state("m", lower=0.0, upper=1.5)
    P = ocp.unknown("P", lower=0.0)
    h = ocp.control("h", lower=0.0, upper=25.0)
    ocp.duration(T)

    t = ocp.t
    density = rate * ca.exp(-rate * t) + math.exp(-rate * T) / T
    effect = m**2 / (1 + m**2)
    slope = 2 * m / (1 + m**2) ** 2
    revenue = 1 - P + I - m
    health = 1.5 - gamma * t * (1 - effect)
    utility = 1 - ca.exp(-10 * revenue) + health
    marginal = 10 * ca.exp(-10 * revenue)
    ocp.minimise(running=-utility * density)

    ocp.dynamics(I, (1 - gamma * t * slope / marginal) * h)
    ocp.dynamics(m, h)
    premium = ocp.integral(I * density, name="premium")

    ocp.constrain(revenue, lower=0.0, name="revenue")
    ocp.constrain(health, lower=0.0, name="health")
    ocp.constrain(utility, lower=0.0, name="utility")
    ocp.constrain(marginal, lower=0.001, name="marginal utility")

    ocp.start(I, 0.0)
    ocp.start(m, 0.001)
    ocp.end_constraint(premium == P)
    return ocp


def jackson() -> OptimalControlProblem:
    """Two catalysts mixed along a reactor for the most of the last product (Jackson, 1968).

        maximise x3(4)   subject to   x1' = -u (x1 - 10 x2),   x2' = u (x1 - 10 x2) - (1 - u) x2,   x3' = (1 - u) x2,
            0 <= u <= 1,   0 <= x <= 1.1,   x(0) = (1, 0, 0)

    All of the first catalyst, a singular arc, none of it (jackson.jl, from Bocop).
    """
    ocp = OptimalControlProblem("Jackson")

    x1, x2, x3 = (ocp.state(f"x{k}", lower=0.0, upper=1.1) for k in (1, 2, 3))
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.duration(4.0)

    ocp.minimise(terminal=-x3)

    ocp.dynamics(x1, -u * (x1 - 10 * x2))
    ocp.dynamics(x2, u * (x1 - 10 * x2) - (1 - u) * x2)
    ocp.dynamics(x3, (1 - u) * x2)

    for state, start in ((x1, 1.0), (x2, 0.0), (x3, 0.0)):
        ocp.start(state, start)
    return ocp


def robertson() -> OptimalControlProblem:
    """Three species that react at rates of very different size: a stiff initial value problem (Robertson, 1966).

        z(40) of   x' = -0.04 x + 10^4 y z,   y' = 0.04 x - 10^4 y z - 3 10^7 y^2,   z' = 3 10^7 y^2,   (1, 0, 0) at 0

    There is nothing to choose. The page of OptimalControlProblems.jl maximises z(T); its code minimises ∫ u^2 dt of a
    control that acts on nothing, and dymos simulates.
    """
    ocp = OptimalControlProblem("Robertson")

    x = ocp.state("x", guess=1.0)
    y = ocp.state("y", guess=0.0)
    z = ocp.state("z", guess=0.0)
    ocp.duration(40.0)

    ocp.minimise(terminal=-z)

    first, second, third = 0.04 * x, 1e4 * y * z, 3e7 * y**2
    ocp.dynamics(x, -first + second)
    ocp.dynamics(y, first - second - third)
    ocp.dynamics(z, third)

    for state, start in ((x, 1.0), (y, 0.0), (z, 0.0)):
        ocp.start(state, start)
    return ocp
