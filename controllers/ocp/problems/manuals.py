"""Problems of the manuals of optimal control software: PSOPT, PROPT, GPOPS-II, dymos, JModelica."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@cache
def brachistochrone(gravity: float = 9.8) -> ProblemFunctions:
    """The brachistochrone: the wire on which a bead slides from rest in the least time (Johann Bernoulli, 1696).

        minimise T   subject to   x' = v sin θ,   y' = v cos θ,   v' = g cos θ,   0 <= θ <= 2π

    with y downwards, θ from the vertical. ``brachistochrone`` slides from (0, 0) to (2, 2): T* = 0.8247591 for g = 9.8
    (manual of PSOPT), 0.8243387 for g = 9.81 (manual of GPOPS-II). ``brachistochrone_drop`` has y upwards, slides from
    (0, 10) to (10, 5) with g = 9.80665 and takes T* = 1.8016031 (documentation of dymos).
    """
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


@cache
def hypersensitive() -> ProblemFunctions:
    """The hypersensitive problem: a boundary layer at either end, and nothing in between (Rao and Mease, 2000).

        minimise 1/2 ∫_0^T x^2 + u^2 dt   subject to   x' = -x^3 + u,   x(0) and x(T) given

    For large T the optimum does not depend on T: it goes to rest along one branch of u = x^3 ± x sqrt(x^4 + 1) and away
    along the other. With J = S(x(0), -1) + S(x(T), 1), S(a, ±1) = ∫_0^a x sqrt(x^4 + 1) ± x^3 dx,

        J* = 3.3620571 from 1 to 1.5 in T = 10^4,        J* = 1.3308069 from 1.5 to 1 in T = 50.
    """
    return _layers("hypersensitive", 1.0, 1.5, 1e4)


@cache
def hypersensitive_short() -> ProblemFunctions:
    """Transfer from 1.5 to 1 in 50 s."""
    return _layers("hypersensitive, short", 1.5, 1.0, 50.0)


def _layers(name: str, start: float, end: float, duration: float) -> ProblemFunctions:
    ocp = OptimalControlProblem(name)

    x = ocp.state("x", guess=(start, 0.0, end))
    u = ocp.control("u")
    ocp.duration(duration)

    ocp.minimise(running=(x**2 + u**2) / 2)

    ocp.dynamics(x, -(x**3) + u)

    ocp.start(x, start)
    ocp.end(x, end)
    return ocp.functions()


@cache
def lander() -> ProblemFunctions:
    """Soft landing with the least fuel, the mass falling as fuel burns (manuals of PROPT and PSOPT, "moon lander").

        minimise ∫_0^T F dt   subject to   h' = v,   v' = -1 + F / m,   m' = -F / 2.349,   0 <= F <= 1.227,
                                           (1, -0.783, 1) to h = 0, v = 0,   T free

    The optimum falls and then brakes with all it has: J* = 1.4203128.
    """
    GRAVITY, MOST_THRUST, EXHAUST_SPEED = 1.0, 1.227, 2.349
    ocp = OptimalControlProblem("lander")

    h = ocp.state("h", lower=-20.0, upper=20.0, guess=(1.0, 0.0))
    v = ocp.state("v", lower=-20.0, upper=20.0, guess=(-0.783, 0.0))
    m = ocp.state("m", lower=0.01, upper=1.0, guess=(1.0, 0.2))
    F = ocp.control("F", lower=0.0, upper=MOST_THRUST, guess=(MOST_THRUST / 2, MOST_THRUST / 2))
    ocp.free_duration(guess=1.5, lower=0.1, upper=1000.0)

    ocp.minimise(running=F)

    ocp.dynamics(h, v)
    ocp.dynamics(v, -GRAVITY + F / m)
    ocp.dynamics(m, -F / EXHAUST_SPEED)

    ocp.start(h, 1.0)
    ocp.start(v, -0.783)
    ocp.start(m, 1.0)
    ocp.end(h, 0.0)
    ocp.end(v, 0.0)
    return ocp.functions()


@cache
def lunar_landing() -> ProblemFunctions:
    """Soft landing on the moon with the least fuel, the mass constant (Meditch, IEEE TAC 9, 1964; GPOPS-II manual).

        minimise ∫_0^T u dt   subject to   h' = v,   v' = u - g,   0 <= u <= 3,   g = 1.5,   (10, -2) to (0, 0),
                                           T free

    The optimum falls and then brakes with all it has: J* = 2 √17.
    """
    GRAVITY, MOST_THRUST = 1.5, 3.0
    ocp = OptimalControlProblem("lunar landing")

    h = ocp.state("h", scale=10.0, guess=(10.0, 0.0))
    v = ocp.state("v", scale=5.0, guess=(-2.0, 0.0))
    u = ocp.control("u", lower=0.0, upper=MOST_THRUST, guess=(0.0, MOST_THRUST))
    ocp.free_duration(guess=5.0, lower=0.5, upper=200.0)

    ocp.minimise(running=u)

    ocp.dynamics(h, v)
    ocp.dynamics(v, u - GRAVITY)

    ocp.start(h, 10.0)
    ocp.start(v, -2.0)
    ocp.end(h, 0.0)
    ocp.end(v, 0.0)
    return ocp.functions()


@cache
def container_crane() -> ProblemFunctions:
    """A container crane that moves its load with the least swing (Sakawa and Shindo, 1982; Teo, Goh and Wong; PSOPT).

        minimise 1/2 ∫_0^9 x3^2 + x6^2 dt   subject to   x1' = x4,   x2' = x5,   x3' = x6,
            x4' = u1 + 17.2656 x3,   x5' = u2,   x6' = -(u1 + 27.0756 x3 + 2 x5 x6) / x2,
            |u1| <= 2.83374,   -0.80865 <= u2 <= 0.71265,   |x4| <= 2.5,   |x5| <= 1,
            (0, 22, 0, 0, -1, 0) to (10, 14, 0, 2.5, 0, 0)

    x1 is the trolley's place, x2 the length of the rope, x3 its angle. Both controls enter linearly and cost nothing:
    bangs, singular arcs and arcs on the bounds of the speeds. J* = 5.1503848e-3; the 5.14982e-3 that is often seen
    comes from a grid that is too coarse.
    """
    START, END = (0.0, 22.0, 0.0, 0.0, -1.0, 0.0), (10.0, 14.0, 0.0, 2.5, 0.0, 0.0)
    ocp = OptimalControlProblem("container crane")

    speeds = {"x4": 2.5, "x5": 1.0}  # bounds
    scales = (10.0, 10.0, 0.1, 2.5, 1.0, 0.1)
    x = [
        ocp.state(
            f"x{k + 1}",
            lower=-speeds.get(f"x{k + 1}", 50.0),
            upper=speeds.get(f"x{k + 1}", 50.0),
            scale=scales[k],
            guess=(START[k], END[k]),
        )
        for k in range(6)
    ]
    _, x2, x3, x4, x5, x6 = x
    u1 = ocp.control("u1", lower=-2.83374, upper=2.83374)
    u2 = ocp.control("u2", lower=-0.80865, upper=0.71265)
    ocp.duration(9.0)

    ocp.minimise(running=(x3**2 + x6**2) / 2)

    rates = (x4, x5, x6, u1 + 17.2656 * x3, u2, -(u1 + 27.0756 * x3 + 2 * x5 * x6) / x2)
    for state, rate, start, end in zip(x, rates, START, END, strict=True):
        ocp.dynamics(state, rate)
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()


BUNT_MASS, BUNT_GRAVITY, BUNT_AREA = 1005.0, 9.81, 0.3376  # [kg], [m/s^2], [m^2]
BUNT_A1, BUNT_A2, BUNT_A3, BUNT_B1 = -1.9431, -0.1499, 0.2359, 21.9
BUNT_C1, BUNT_C2, BUNT_C3 = 3.312e-9, -1.142e-4, 1.224
BUNT_MOST_LOAD = 4.0  # [g]


@cache
def bunt() -> ProblemFunctions:
    """Terminal bunt manoeuvre: a missile flies low, climbs, dives onto its target (Subchan and Zbikowski, 2009; PSOPT).

        minimise T   subject to   x' = V cos γ,   h' = V sin γ,
            γ' = ((F - D) sin α + L cos α) / (m V) - g cos γ / V,      V' = ((F - D) cos α - L sin α) / m - g sin γ,
            D = q (A1 α^2 + A2 α + A3),   L = q B1 α,   q = ρ V^2 S / 2,   ρ = C1 h^2 + C2 h + C3,
            1000 <= F <= 6000 N,   |α| <= 0.3,   200 <= V <= 310 m/s,   |L| <= 4 m g,
            H (h - 30) + (1 - H) h >= 0,   H = (1 + tanh((7500 - x) / 10)) / 2,
            (γ, V, x, h) = (0, 272, 0, 30) to (-π/2, 310, 10000, 0)

    It flies on the least height of 30 m until it has to climb, at full thrust. T* = 40.911939 s.
    """
    m, g = BUNT_MASS, BUNT_GRAVITY
    ocp = OptimalControlProblem("bunt")

    gamma = ocp.state("gamma", lower=-math.pi / 2, upper=math.pi / 2, guess=(0.0, -math.pi / 2))  # [rad]
    V = ocp.state("V", lower=200.0, upper=310.0, scale=300.0, guess=(272.0, 310.0))  # [m/s]
    x = ocp.state("x", lower=0.0, upper=10000.0, scale=1e4, guess=(0.0, 10000.0))  # [m]
    h = ocp.state("h", lower=0.0, upper=1900.0, scale=1e3, guess=(30.0, 0.0))  # [m]
    F = ocp.control("F", lower=1000.0, upper=6000.0, scale=5e3, guess=(6000.0, 6000.0))  # [N]
    alpha = ocp.control("alpha", lower=-0.3, upper=0.3, scale=0.1)  # [rad]
    T = ocp.free_duration(guess=50.0, lower=10.0, upper=100.0)

    ocp.minimise(terminal=T)

    q = (BUNT_C1 * h**2 + BUNT_C2 * h + BUNT_C3) * V**2 * BUNT_AREA / 2
    D, L = q * (BUNT_A1 * alpha**2 + BUNT_A2 * alpha + BUNT_A3), q * BUNT_B1 * alpha
    sin, cos = ca.sin(alpha), ca.cos(alpha)
    ocp.dynamics(gamma, ((F - D) * sin + L * cos) / (m * V) - g * ca.cos(gamma) / V)
    ocp.dynamics(V, ((F - D) * cos - L * sin) / m - g * ca.sin(gamma))
    ocp.dynamics(x, V * ca.cos(gamma))
    ocp.dynamics(h, V * ca.sin(gamma))

    H = (1 + ca.tanh((7500 - x) / 10)) / 2
    ocp.constrain(L / (m * g), lower=-BUNT_MOST_LOAD, upper=BUNT_MOST_LOAD)
    ocp.constrain((H * (h - 30) + (1 - H) * h) / 1000, lower=0.0)

    for state, start, end in ((gamma, 0.0, -math.pi / 2), (V, 272.0, 310.0), (x, 0.0, 10000.0), (h, 30.0, 0.0)):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()


@cache
def moving_wall() -> ProblemFunctions:
    """A state held below a parabola in time: "stc1" (Jacobson and Lele, 1969; Teo, Goh and Wong; PSOPT).

        minimise ∫_0^1 x1^2 + x2^2 + 0.005 u^2 dt   subject to   x1' = x2,   x2' = -x2 + u,   |u| <= 20,
                                                                 x2 <= 8 (t - 1/2)^2 - 1/2,   x(0) = (0, -1)

    The optimum follows the parabola for a while: J* = 0.1698205.
    """
    ocp = OptimalControlProblem("stc1")

    x1 = ocp.state("x1", lower=-2.0, upper=2.0)
    x2 = ocp.state("x2", lower=-2.0, upper=2.0, guess=(-1.0, 0.0))
    u = ocp.control("u", lower=-20.0, upper=20.0, scale=5.0)
    ocp.duration(1.0)

    ocp.minimise(running=x1**2 + x2**2 + 0.005 * u**2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, -x2 + u)

    ocp.constrain(8 * (ocp.t - 0.5) ** 2 - 0.5 - x2, lower=0.0)

    ocp.start(x1, 0.0)
    ocp.start(x2, -1.0)
    return ocp.functions()


@cache
def two_link_arm() -> ProblemFunctions:
    """A robot arm of two links, moved in the least time (Luus, Iterative Dynamic Programming, 2000; PROPT and PSOPT).

        minimise T   subject to   θ' = ω2 - ω1,   φ' = ω1,   |u| <= 1,
            ω1' = (sin θ (9/4 cos θ ω1^2 + 2 ω2^2) + 4/3 (u1 - u2) - 3/2 cos θ u2) / d,
            ω2' = -(sin θ (7/2 ω1^2 + 9/4 cos θ ω2^2) - 7/3 u2 + 3/2 cos θ (u1 - u2)) / d,   d = 31/36 + 9/4 sin^2 θ,
            (ω1, ω2, θ, φ) = (0, 0, 0.5, 0) to (0, 0, 0.5, 0.522)

    Both torques are bang-bang: T* = 2.9822799.
    """
    ocp = OptimalControlProblem("two-link arm")

    w1 = ocp.state("w1", lower=-2.0, upper=2.0)
    w2 = ocp.state("w2", lower=-2.0, upper=2.0)
    theta = ocp.state("theta", lower=-2.0, upper=2.0, guess=(0.5, 0.5))  # [rad]
    phi = ocp.state("phi", lower=-2.0, upper=2.0, guess=(0.522, 0.522))  # [rad]
    u1 = ocp.control("u1", lower=-1.0, upper=1.0)
    u2 = ocp.control("u2", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=3.0, lower=1.0, upper=10.0)

    ocp.minimise(terminal=T)

    sin, cos = ca.sin(theta), ca.cos(theta)
    inertia = 31 / 36 + 9 / 4 * sin**2
    ocp.dynamics(w1, (sin * (9 / 4 * cos * w1**2 + 2 * w2**2) + 4 / 3 * (u1 - u2) - 3 / 2 * cos * u2) / inertia)
    ocp.dynamics(w2, -(sin * (7 / 2 * w1**2 + 9 / 4 * cos * w2**2) - 7 / 3 * u2 + 3 / 2 * cos * (u1 - u2)) / inertia)
    ocp.dynamics(theta, w2 - w1)
    ocp.dynamics(phi, w1)

    for state, start, end in ((w1, 0.0, 0.0), (w2, 0.0, 0.0), (theta, 0.5, 0.5), (phi, 0.0, 0.522)):
        ocp.start(state, start)
        ocp.end(state, end)
    return ocp.functions()


@cache
def van_der_pol() -> ProblemFunctions:
    """The van der Pol oscillator, brought to rest with a control that is bounded on one side.

        minimise ∫_0^20 x1^2 + x2^2 + u^2 dt   subject to   x1' = (1 - x2^2) x1 - x2 + u,   x2' = x1,
                                                            u <= 0.75,   x(0) = (0, 1)

    J* = 3.1749818; JModelica's documentation prints 3.1761958, with 50 elements.
    """
    ocp = OptimalControlProblem("van der Pol")

    x1 = ocp.state("x1")
    x2 = ocp.state("x2", guess=(1.0, 0.0))
    u = ocp.control("u", upper=0.75)
    ocp.duration(20.0)

    ocp.minimise(running=x1**2 + x2**2 + u**2)

    ocp.dynamics(x1, (1 - x2**2) * x1 - x2 + u)
    ocp.dynamics(x2, x1)

    ocp.start(x1, 0.0)
    ocp.start(x2, 1.0)
    return ocp.functions()
