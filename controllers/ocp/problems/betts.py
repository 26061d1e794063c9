"""Problems that Betts solves by SOS (Practical Methods for Optimal Control, 2010)."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def rayleigh() -> ProblemFunctions:
    """Rayleigh's oscillator with a constraint on state and control together (Betts, SOS; Maurer and Augustin, 2001).

        minimise ∫_0^4.5 u^2 + x1^2 dt   subject to   x1' = x2,   x2' = -x1 + x2 (1.4 - 0.14 x2^2) + 4 u,
                                                      u + x1 / 6 <= 0,   x(0) = (-5, -5)

    J* = 44.804444.
    """
    ocp = OptimalControlProblem("Rayleigh")

    x1 = ocp.state("x1", scale=5.0, guess=(-5.0, 0.0))
    x2 = ocp.state("x2", scale=5.0, guess=(-5.0, 0.0))
    u = ocp.control("u")
    ocp.duration(4.5)

    ocp.minimise(running=u**2 + x1**2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x1 + x2 * (1.4 - 0.14 * x2**2) + 4 * u)

    ocp.constrain(u + x1 / 6, upper=0.0)

    ocp.start(x1, -5.0)
    ocp.start(x2, -5.0)
    return ocp.functions()


@cache
def free_flying_robot() -> ProblemFunctions:
    """A robot that floats and has two pairs of thrusters, brought to rest with the least fuel (Sakawa, 1999; SOS).

        minimise ∫_0^12 u1 + u2 + u3 + u4 dt   subject to
            x'' = (F1 + F2) cos θ,   y'' = (F1 + F2) sin θ,   θ'' = 0.2 F1 - 0.2 F2,   F1 = u1 - u2,   F2 = u3 - u4,
            u >= 0,   u1 + u2 <= 1,   u3 + u4 <= 1,   (-10, -10, π/2) at rest to 0 at rest

    The minimum of the literature has thrusters that are on or off, with eight switchings: J = 7.9101471 (7.910155 is
    often seen, of a grid too coarse). A lower one, J* = 7.6886191, fires them in another order and has a singular arc
    of u4 of 0.58 s; with x and y exchanged, and the thrusters with them, it is another of the same J.
    """
    ARM = 0.2
    ocp = OptimalControlProblem("free-flying robot")

    x = ocp.state("x", scale=10.0, guess=(-10.0, 0.0))
    y = ocp.state("y", scale=10.0, guess=(-10.0, 0.0))
    theta = ocp.state("theta", guess=(math.pi / 2, 0.0))
    dx = ocp.state("dx")
    dy = ocp.state("dy")
    omega = ocp.state("omega", scale=0.3)
    u1, u2, u3, u4 = (ocp.control(f"u{k}", lower=0.0, guess=(0.2, 0.2)) for k in range(1, 5))
    ocp.duration(12.0)

    ocp.minimise(running=u1 + u2 + u3 + u4)

    F1, F2 = u1 - u2, u3 - u4
    ocp.dynamics(x, dx)
    ocp.dynamics(y, dy)
    ocp.dynamics(theta, omega)
    ocp.dynamics(dx, (F1 + F2) * ca.cos(theta))
    ocp.dynamics(dy, (F1 + F2) * ca.sin(theta))
    ocp.dynamics(omega, ARM * (F1 - F2))

    ocp.constrain(u1 + u2, upper=1.0)
    ocp.constrain(u3 + u4, upper=1.0)

    for state, value in ((x, -10.0), (y, -10.0), (theta, math.pi / 2), (dx, 0.0), (dy, 0.0), (omega, 0.0)):
        ocp.start(state, value)
        ocp.end(state, 0.0)
    return ocp.functions()


@cache
def tumour() -> ProblemFunctions:
    """Tumour anti-angiogenesis: a limited dose of a drug that stops a tumour's vessels (Ledzewicz and Schättler, 2007).

        minimise p(T)   subject to   p' = -ξ p ln(p / q),   q' = q (b - μ - d p^(2/3) - G u),
                                     0 <= u <= 75,   ∫ u dt <= 15,   T <= 5,   (p, q)(0) = (p̄ / 2, p̄ / 4)

    p is the tumour's volume, q what its vessels can carry [mm^3], t in days, p̄ = ((b - μ) / d)^(3/2) where both rest.
    The optimum gives the drug as fast as it may and then nothing: p(T)* = 7571.6700. The 7571.6784 in the manuals of
    GPOPS-II and SOS comes from a grid that does not resolve the switch.
    """
    XI, B, D, G, MU = 0.084, 5.85, 0.00873, 0.15, 0.02  # ξ [1/day], b [1/day], d [1/(mm^2 day)], G, μ [1/day]
    MOST_DOSE, MOST_DRUG = 75.0, 15.0
    p_bar = ((B - MU) / D) ** 1.5  # [mm^3]
    ocp = OptimalControlProblem("tumour")

    p = ocp.state("p", lower=1.0, upper=p_bar, scale=1e4, guess=(p_bar / 2, p_bar / 2))
    q = ocp.state("q", lower=1.0, upper=p_bar, scale=1e4, guess=(p_bar / 4, p_bar / 4))
    given = ocp.state("given", upper=MOST_DRUG, scale=10.0, guess=(0.0, MOST_DRUG))  # ∫ u dt
    u = ocp.control("u", lower=0.0, upper=MOST_DOSE, scale=50.0, guess=(MOST_DOSE, MOST_DOSE))
    ocp.free_duration(guess=1.0, lower=0.1, upper=5.0)

    ocp.minimise(terminal=p)

    ocp.dynamics(p, -XI * p * ca.log(p / q))
    ocp.dynamics(q, q * (B - MU - D * p ** (2 / 3) - G * u))
    ocp.dynamics(given, u)

    ocp.start(p, p_bar / 2)
    ocp.start(q, p_bar / 4)
    ocp.start(given, 0.0)
    return ocp.functions()


@cache
def alp_rider() -> ProblemFunctions:
    """The alp rider: stiff dynamics that must stay above a landscape of four narrow peaks in time (Betts, SOS).

        minimise ∫_0^20 100 |x|^2 + 0.01 |u|^2 dt   subject to   (2, 1, 2, 1) to (2, 3, 1, -2),
            x1' = -10 x1 + u1 + u2,              x2' = -2 x2 + u1 + 2 u2,
            x3' = -3 x3 + 5 x4 + u1 - u2,        x4' = 5 x3 - 3 x4 + u1 + 3 u2,
            |x|^2 >= 3 p(t; 3, 12) + 3 p(t; 6, 10) + 3 p(t; 10, 6) + 8 p(t; 15, 4) + 0.01,
            p(t; a, b) = exp(-b (t - a)^2)

    The constraint binds from t = 0.36 to 18.43, between layers of 0.01 s at both ends: J* = 2030.8543. Ways over a peak
    with x mirrored to -x are local optima that cost 1e-7 more.
    """
    PEAKS = ((3.0, 3.0, 12.0), (3.0, 6.0, 10.0), (3.0, 10.0, 6.0), (8.0, 15.0, 4.0))  # height, a, b
    START, END = (2.0, 1.0, 2.0, 1.0), (2.0, 3.0, 1.0, -2.0)
    ocp = OptimalControlProblem("alp rider")

    x = ca.vertcat(*(ocp.state(f"x{k + 1}", guess=(START[k], 1.0, END[k])) for k in range(4)))
    x1, x2, x3, x4 = ca.vertsplit(x)
    u1 = ocp.control("u1", scale=10.0)
    u2 = ocp.control("u2", scale=10.0)
    ocp.duration(20.0)

    ocp.minimise(running=100 * ca.sumsqr(x) + 0.01 * (u1**2 + u2**2))

    ocp.dynamics(x1, -10 * x1 + u1 + u2)
    ocp.dynamics(x2, -2 * x2 + u1 + 2 * u2)
    ocp.dynamics(x3, -3 * x3 + 5 * x4 + u1 - u2)
    ocp.dynamics(x4, 5 * x3 - 3 * x4 + u1 + 3 * u2)

    landscape = sum((height * ca.exp(-b * (ocp.t - a) ** 2) for height, a, b in PEAKS), ca.SX(0.01))
    ocp.constrain(ca.sumsqr(x) - landscape, lower=0.0)

    for state, start, end in zip((x1, x2, x3, x4), START, END, strict=True):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()
