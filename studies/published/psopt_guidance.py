"""Examples of PSOPT from flight: steering, a missile, a landing and a re-entry; each as its file states it."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement


def lts() -> OptimalControlProblem:
    """A particle of constant thrust, steered to a height and a speed in the least time (Bryson and Ho, 2.4; Betts).

        minimise T   subject to   x1' = x2,   x2' = 100 cos u,   x3' = x4,   x4' = 100 sin u,   |u| <= π/2,
                                  |x| <= 100,   x(0) = 0 to x2 = 45, x3 = 5, x4 = 0,   T <= 1

    The optimum follows the linear tangent law: T* = 0.55457088.
    """
    ocp = OptimalControlProblem("PSOPT: lts")

    ends = {"x1": 12.0, "x2": 45.0, "x3": 5.0, "x4": 0.0}
    x = [ocp.state(name, lower=-100.0, upper=100.0, guess=(0.0, end)) for name, end in ends.items()]
    u = ocp.control("u", lower=-math.pi / 2, upper=math.pi / 2, guess=1.0)  # [rad]
    T = ocp.free_duration(guess=1.0, upper=1.0)

    ocp.minimise(terminal=T)

    for state, rate in zip(x, (x[1], 100 * ca.cos(u), x[3], 100 * ca.sin(u)), strict=True):
        ocp.dynamics(state, rate)

    ocp.start(ca.vertcat(*x), 0.0)
    ocp.end(ca.vertcat(*x[1:]), [45.0, 5.0, 0.0])
    return ocp


def missile() -> OptimalControlProblem:
    """Terminal bunt manoeuvre: a missile flies low, climbs, dives onto its target (Subchan and Zbikowski, 2009).

        minimise T   subject to   x' = V cos γ,   h' = V sin γ,
            γ' = ((F - D) sin α + L cos α) / (m V) - g cos γ / V,      V' = ((F - D) cos α - L sin α) / m - g sin γ,
            D = q (A1 α^2 + A2 α + A3),   L = q B1 α,   q = ρ V^2 S / 2,   ρ = C1 h^2 + C2 h + C3,
            1000 <= F <= 6000 N,   |α| <= 0.3,   200 <= V <= 310 m/s,   0 <= x <= 10000 m,   0 <= h <= 1900 m,
            |L| <= 4 m g,   0 <= H (h - 30) + (1 - H) h <= 1900,   H = (1 + tanh((7500 - x) / 10)) / 2,
            (γ, V, x, h) = (0, 272, 0, 30) to (-π/2, 310, 10000, 0),   10 <= T <= 100

    It flies on the least height of 30 m until it has to climb, at full thrust. T* = 40.911939 s.
    """
    MASS, GRAVITY, AREA = 1005.0, 9.81, 0.3376  # [kg], [m/s^2], [m^2]
    A1, A2, A3, B1 = -1.9431, -0.1499, 0.2359, 21.9
    C1, C2, C3 = 3.312e-9, -1.142e-4, 1.224
    ocp = OptimalControlProblem("PSOPT: missile")

    gamma = ocp.state("gamma", lower=-math.pi / 2, upper=math.pi / 2, guess=(0.0, -math.pi / 2))  # [rad]
    V = ocp.state("V", lower=200.0, upper=310.0, guess=(272.0, 310.0))  # [m/s]
    x = ocp.state("x", lower=0.0, upper=10000.0, guess=(0.0, 10000.0))  # [m]
    h = ocp.state("h", lower=0.0, upper=1900.0, guess=(30.0, 0.0))  # [m]
    F = ocp.control("F", lower=1000.0, upper=6000.0, guess=6000.0)  # [N]
    alpha = ocp.control("alpha", lower=-0.3, upper=0.3)  # [rad]
    T = ocp.free_duration(guess=50.0, lower=10.0, upper=100.0)

    ocp.minimise(terminal=T)

    q = (C1 * h**2 + C2 * h + C3) * V**2 * AREA / 2
    D, L = q * (A1 * alpha**2 + A2 * alpha + A3), q * B1 * alpha
    sin, cos = ca.sin(alpha), ca.cos(alpha)
    ocp.dynamics(gamma, ((F - D) * sin + L * cos) / (MASS * V) - GRAVITY * ca.cos(gamma) / V)
    ocp.dynamics(V, ((F - D) * cos - L * sin) / MASS - GRAVITY * ca.sin(gamma))
    ocp.dynamics(x, V * ca.cos(gamma))
    ocp.dynamics(h, V * ca.sin(gamma))

    H = (1 + ca.tanh((7500 - x) / 10)) / 2
    ocp.constrain(L / (MASS * GRAVITY), lower=-4.0, upper=4.0)
    ocp.constrain(H * (h - 30) + (1 - H) * h, lower=0.0, upper=1900.0)

    states = ca.vertcat(gamma, V, x, h)
    ocp.start(states, [0.0, 272.0, 0.0, 30.0])
    ocp.end(states, [-math.pi / 2, 310.0, 10000.0, 0.0])
    return ocp


def moon() -> OptimalControlProblem:
    """Soft landing on the moon with the least fuel, the mass falling as fuel burns (manual of PROPT).

        minimise ∫_0^T F dt   subject to   h' = v,   v' = -1 + F / m,   m' = -F / 2.349,   0 <= F <= 1.227,
                                           |h|, |v| <= 20,   0.01 <= m <= 1,   T <= 1000,
                                           (1, -0.783, 1) to h = 0, v = 0

    The optimum falls and then brakes with all it has: J* = 1.4203126.
    """
    ocp = OptimalControlProblem("PSOPT: moon")

    h = ocp.state("h", lower=-20.0, upper=20.0, guess=(1.0, 0.0))
    v = ocp.state("v", lower=-20.0, upper=20.0, guess=(-0.783, 0.0))
    m = ocp.state("m", lower=0.01, upper=1.0, guess=(1.0, 0.01))
    F = ocp.control("F", lower=0.0, upper=1.227, guess=0.6135)
    ocp.free_duration(guess=1.5, upper=1000.0)

    ocp.minimise(running=F)

    ocp.dynamics(h, v)
    ocp.dynamics(v, -1 + F / m)
    ocp.dynamics(m, -F / 2.349)

    ocp.start(ca.vertcat(h, v, m), [1.0, -0.783, 1.0])
    ocp.end(ca.vertcat(h, v), 0.0)
    return ocp


def shuttle_reentry() -> OptimalControlProblem:
    """Re-entry of the space shuttle with the greatest crossrange (Betts, 2010), in feet and seconds.

        minimise -θ(T) 180 / π   subject to   h' = V sin γ,
            φ' = V cos γ sin ψ / (r cos θ),                  θ' = V cos γ cos ψ / r,
            V' = -D / m - g sin γ,                           γ' = L cos β / (m V) + cos γ (V / r - g / V),
            ψ' = L sin β / (m V cos γ) + V cos γ sin ψ sin θ / (r cos θ),
            r = R + h,   g = μ / r^2,   q = ρ V^2 / 2,   ρ = ρ_0 e^(-h / 23800),   with α in degrees
            D = q S (0.07854 - 6.1592e-3 α + 6.21408e-4 α^2),   L = q S (-0.20704 + 0.029244 α),
            -90° <= β <= 1°,   |α| <= 89°,   from 260000 ft, 25600 ft/s, γ = -1° to 80000 ft, 2500 ft/s, γ = -5°

    Angle of attack α and bank angle β steer; there is no limit on the heating. θ(T)* = 34.1412 degrees.
    """
    MASS = 203000.0 / 32.174  # [slug]
    RADIUS, MU, AREA = 20902900.0, 0.14076539e17, 2690.0  # [ft], [ft^3/s^2], [ft^2]
    DENSITY, SCALE_HEIGHT = 0.002378, 23800.0  # [slug/ft^3], [ft]
    DEGREE = math.pi / 180.0
    ocp = OptimalControlProblem("PSOPT: shuttle_reentry")

    h = ocp.state("h", lower=0.0, upper=300000.0, guess=(260000.0, 80000.0))  # [ft]
    phi = ocp.state("phi", lower=-45 * DEGREE, upper=45 * DEGREE, guess=-45 * DEGREE)  # [rad] longitude
    theta = ocp.state("theta", lower=-89 * DEGREE, upper=89 * DEGREE, guess=-89 * DEGREE)  # [rad] latitude
    V = ocp.state("V", lower=1000.0, upper=40000.0, guess=(25600.0, 2500.0))  # [ft/s]
    gamma = ocp.state("gamma", lower=-89 * DEGREE, upper=89 * DEGREE, guess=(-DEGREE, -5 * DEGREE))  # [rad] flight path
    psi = ocp.state("psi", lower=-math.pi, upper=math.pi, guess=(math.pi / 2, -math.pi / 2))  # [rad] azimuth
    alpha = ocp.control("alpha", lower=-89 * DEGREE, upper=89 * DEGREE)  # [rad]
    beta = ocp.control("beta", lower=-90 * DEGREE, upper=DEGREE, guess=DEGREE)  # [rad]
    ocp.free_duration(guess=1000.0, lower=100.0, upper=4000.0)

    ocp.minimise(terminal=-theta / DEGREE)

    r = RADIUS + h
    g = MU / r**2
    q = DENSITY * ca.exp(-h / SCALE_HEIGHT) * V**2 / 2
    a = alpha / DEGREE
    D = q * AREA * (0.07854 - 6.1592e-3 * a + 6.21408e-4 * a**2)
    L = q * AREA * (-0.20704 + 0.029244 * a)
    over_ground = V * ca.cos(gamma) / r
    ocp.dynamics(h, V * ca.sin(gamma))
    ocp.dynamics(phi, over_ground * ca.sin(psi) / ca.cos(theta))
    ocp.dynamics(theta, over_ground * ca.cos(psi))
    ocp.dynamics(V, -D / MASS - g * ca.sin(gamma))
    ocp.dynamics(gamma, L * ca.cos(beta) / (MASS * V) + ca.cos(gamma) * (V / r - g / V))
    ocp.dynamics(psi, L * ca.sin(beta) / (MASS * V * ca.cos(gamma)) + over_ground * ca.sin(psi) * ca.tan(theta))

    start = [260000.0, -0.5 * 75.3153 * DEGREE, 0.0, 25600.0, -DEGREE, math.pi / 2]
    ocp.start(ca.vertcat(h, phi, theta, V, gamma, psi), start)
    ocp.end(ca.vertcat(h, V, gamma), [80000.0, 2500.0, -5 * DEGREE])
    return ocp


STATEMENTS: dict[str, Statement] = {
    "lts": lts,
    "missile": missile,
    "moon": moon,
    "shuttle_reentry": shuttle_reentry,
}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "lts": (0.554570878335, "Gauss-Legendre and Radau, 20 x 5 and 40 x 5"),
    "missile": (40.911939072, "that of the collection's: two discretisations on arcs"),
    "moon": (1.4203125990, "that of the collection's: two discretisations on arcs"),
    "shuttle_reentry": (-34.14118428, "Gauss-Legendre and Radau, 40 x 5 and 80 x 5"),
}

DETAILS: dict[str, Details] = {
    "lts": {"note": "the collection's steering, but for bounds that do not hold"},
    "missile": {"note": "the problem 'bunt' of the collection, stated again"},
    "moon": {"note": "the problem 'lander' of the collection, stated again"},
    "user": {"same_as": "PSOPT: bryson_max_range"},
}
