"""Academic examples of PSOPT whose controls switch or rest on a bound; each as its file states it."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement


def mpec() -> OptimalControlProblem:
    """Differential equation with a sign in it, as a penalty on complementarity (Betts, 2010; Baumrucker and Biegler).

        minimise (y(2) - 5/3)^2 + ∫_0^2 y^2 + 1000 (p (s + 1) + q (1 - s)) dt   subject to
            y' = 2 - s,   y = q - p,   |s| <= 1,   0 <= p, q <= 10,   |y| <= 10,   y(0) = -1

    s is the sign of y where the penalty is 0. The optimum rises at the rate 3 to y = -η, then at the rate 1: it pays
    some penalty to cross 0 later. J(η) is a cubic whose least value is J* = 1.6534647.
    """
    ocp = OptimalControlProblem("PSOPT: mpec")

    y = ocp.state("y", lower=-10.0, upper=10.0, guess=-1.0)
    s = ocp.control("s", lower=-1.0, upper=1.0)
    p = ocp.control("p", lower=0.0, upper=10.0)
    q = ocp.control("q", lower=0.0, upper=10.0)
    ocp.duration(2.0)

    ocp.minimise(running=y**2 + 1e3 * (p * (s + 1) + q * (1 - s)), terminal=(y - 5 / 3) ** 2)

    ocp.dynamics(y, 2 - s)

    ocp.constrain(-y - p + q == 0)

    ocp.start(y, -1.0)
    return ocp


def rayleigh() -> OptimalControlProblem:
    """Rayleigh's oscillator with a constraint on state and control together (Betts; Maurer and Augustin, 2001).

        minimise ∫_0^4.5 u^2 + x1^2 dt   subject to   x1' = x2,   x2' = -x1 + x2 (1.4 - 0.14 x2^2) + 4 u,
                                                      -100 <= u + x1 / 6 <= 0,   |x|, |u| <= 10,   x(0) = (-5, -5)

    J* = 44.804444.
    """
    ocp = OptimalControlProblem("PSOPT: rayleigh")

    x1 = ocp.state("x1", lower=-10.0, upper=10.0, guess=-5.0)
    x2 = ocp.state("x2", lower=-10.0, upper=10.0, guess=-5.0)
    u = ocp.control("u", lower=-10.0, upper=10.0)
    ocp.duration(4.5)

    ocp.minimise(running=u**2 + x1**2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x1 + x2 * (1.4 - 0.14 * x2**2) + 4 * u)

    ocp.constrain(u + x1 / 6, lower=-100.0, upper=0.0)

    ocp.start(ca.vertcat(x1, x2), -5.0)
    return ocp


def singular5() -> OptimalControlProblem:
    """Regulator whose control is singular in the end (Luus, 2002).

        minimise ∫_0^1 x1^2 + x2^2 + 0.0005 (x2 + 16 t - 8 - 0.1 x3 u^2)^2 dt   subject to
            x1' = x2,   x2' = -x3 u + 16 t - 8,   x3' = u,   0 <= u <= 10,   x(0) = (0, -1, -√5)

    J* = 0.1192.
    """
    ocp = OptimalControlProblem("PSOPT: singular5")

    x1 = ocp.state("x1")
    x2 = ocp.state("x2", guess=-1.0)
    x3 = ocp.state("x3", guess=-math.sqrt(5.0))
    u = ocp.control("u", lower=0.0, upper=10.0)
    ocp.duration(1.0)

    t = ocp.t
    ocp.minimise(running=x1**2 + x2**2 + 0.0005 * (x2 + 16 * t - 8 - 0.1 * x3 * u**2) ** 2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x3 * u + 16 * t - 8)
    ocp.dynamics(x3, u)

    ocp.start(ca.vertcat(x1, x2, x3), [0.0, -1.0, -math.sqrt(5.0)])
    return ocp


def stc1() -> OptimalControlProblem:
    """A state held below a parabola in time (Jacobson and Lele, 1969; Teo, Goh and Wong).

        minimise ∫_0^1 x1^2 + x2^2 + 0.005 u^2 dt   subject to   x1' = x2,   x2' = -x2 + u,   |x| <= 2,   |u| <= 20,
                                                                 x2 <= 8 (t - 1/2)^2 - 1/2,   x(0) = (0, -1)

    J* = 0.1698205.
    """
    ocp = OptimalControlProblem("PSOPT: stc1")

    x1 = ocp.state("x1", lower=-2.0, upper=2.0)
    x2 = ocp.state("x2", lower=-2.0, upper=2.0)
    u = ocp.control("u", lower=-20.0, upper=20.0)
    ocp.duration(1.0)

    ocp.minimise(running=x1**2 + x2**2 + 0.005 * u**2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x2 + u)

    ocp.constrain(-(8 * (ocp.t - 0.5) ** 2 - 0.5 - x2), lower=-100.0, upper=0.0)

    ocp.start(ca.vertcat(x1, x2), [0.0, -1.0])
    return ocp


def steps() -> MultiPhaseProblem:
    """A linear problem with three steps of the control, on three segments of 1 s.

        minimise ∫_0^3 x dt   subject to   x' = u,   |u| <= 1,   0 <= x <= 5,   x(0) = x(3) = 1

    x falls to 0 as fast as it may, rests there, and rises as fast as it may: J* = 1.
    """
    problem = MultiPhaseProblem("PSOPT: steps")

    segments = [problem.phase(f"segment {k}") for k in (1, 2, 3)]
    states = []
    for segment in segments:
        x = segment.state("x", lower=0.0, upper=5.0, guess=1.0)
        u = segment.control("u", lower=-1.0, upper=1.0)
        segment.duration(1.0)
        segment.minimise(running=x)
        segment.dynamics(x, u)
        states.append(x)
    segments[0].start(states[0], 1.0)
    segments[2].end(states[2], 1.0)
    problem.link(segments[0], segments[1])
    problem.link(segments[1], segments[2])
    return problem


def twophase_schwartz() -> MultiPhaseProblem:
    """Two phases, the first of which goes around an ellipse and has little control (Schwartz, 1989).

        minimise 5 |x(2.9)|^2   subject to   x1' = x2,   x2' = u - 0.1 (1 + 2 x1^2) x2,   -20 <= x1 <= 10,   x2 <= 10,
            until t = 1:   |u| <= 1,   x2 >= -0.8,   -100 <= 1 - 9 (x1 - 1)^2 - ((x2 - 0.4) / 0.3)^2 <= 0,
            from there:    |u| <= 50,   x2 >= -10,   x(0) = (1, 1)

    The control of the second phase suffices to end at 0, in many ways: J* = 0.
    """
    problem = MultiPhaseProblem("PSOPT: twophase_schwartz")

    phases = [(problem.phase("around"), 1.0, -0.8, 1.0), (problem.phase("home"), 1.9, -10.0, 50.0)]
    for phase, duration, lowest, most in phases:
        x1 = phase.state("x1", lower=-20.0, upper=10.0, guess=1.0)
        x2 = phase.state("x2", lower=lowest, upper=10.0, guess=1.0)
        u = phase.control("u", lower=-most, upper=most)
        phase.duration(duration)
        phase.dynamics(x1, x2)
        phase.dynamics(x2, u - 0.1 * (1 + 2 * x1**2) * x2)
        if duration == 1.0:
            phase.constrain(1 - 9 * (x1 - 1) ** 2 - ((x2 - 0.4) / 0.3) ** 2, lower=-100.0, upper=0.0)
            phase.start(ca.vertcat(x1, x2), 1.0)
        else:
            phase.minimise(terminal=5 * (x1**2 + x2**2))
    problem.link(phases[0][0], phases[1][0])
    return problem


def wheat() -> OptimalControlProblem:
    """Trading wheat at a price that varies over the year, with storage and fees (after Norman, 1970).

        minimise -(c + p w)(12)   subject to   c' = 0.01 c - 0.2 w - p (b + s) - 0.01 b + 0.05 s,
            w' = -0.05 w + b + s,   p(t) = 1 + sin(4π t / 12 + 3π / 2) / 2,   0 <= b <= 1,   -1 <= s <= 0,
            c, w >= 0,   (c, w)(0) = (1, 0)

    c is the cash, w the wheat in store, b what is bought and s what is sold, t in months. All is linear but for the
    price: wheat is bought at the lowest prices for all the cash there is, and sold at the highest.
    """
    ocp = OptimalControlProblem("PSOPT: wheat")

    c = ocp.state("c", lower=0.0, guess=1.0)
    w = ocp.state("w", lower=0.0)
    buy = ocp.control("buy", lower=0.0, upper=1.0)
    sell = ocp.control("sell", lower=-1.0, upper=0.0)
    T = ocp.duration(12.0)

    def price(t: ca.SX) -> ca.SX:
        return 1 + 0.5 * ca.sin(4 * math.pi / 12 * t + 3 * math.pi / 2)

    ocp.minimise(terminal=-(c + price(T) * w))

    p = price(ocp.t)
    ocp.dynamics(c, 0.01 * c - 0.2 * w - p * buy - p * sell - 0.01 * buy + 0.05 * sell)
    ocp.dynamics(w, -0.05 * w + buy + sell)

    ocp.start(c, 1.0)
    ocp.start(w, 0.0)
    return ocp


STATEMENTS: dict[str, Statement] = {
    "mpec": mpec,
    "rayleigh": rayleigh,
    "singular5": singular5,
    "stc1": stc1,
    "steps": steps,
    "twophase_schwartz": twophase_schwartz,
    "wheat": wheat,
}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "mpec": (
        1.6534646638341,
        "closed form: least (1 - η^3) / 9 + (z^3 + η^3) / 3 + 1000 η^2 + (z - 5/3)^2, z = (5 - 2 η) / 3",
    ),
    "rayleigh": (44.804444893, "that of the collection's: two discretisations on arcs"),
    "singular5": (0.1192475425, "Gauss-Legendre and Radau on six arcs, 28 x 5 and 28 x 7"),
    "stc1": (0.16982053634, "that of the collection's: two discretisations on arcs"),
    "steps": (1.0, "closed form: two triangles of 1/2"),
    "twophase_schwartz": (0.0, "closed form: the origin is reached"),
    "wheat": (-1.750373975, "Gauss-Legendre and Radau on ten arcs, 30 x 5 and 30 x 7; it is a linear programme"),
}

DETAILS: dict[str, Details] = {
    "mpec": {"note": "the printed value is 1.5 % above the optimum"},
    "rayleigh": {"note": "the collection's, but for bounds that do not hold; the printed value is below the optimum"},
    "stc1": {"note": "the problem 'stc1' of the collection, stated again"},
    "steps": {"singular": True},
    "twophase_schwartz": {"note": "the optimum is not unique; what is printed is 0 but for rounding"},
    "wheat": {"singular": True, "note": "the printed value is 0.4 % above the optimum"},
}
