"""Examples of PSOPT from mechanics and geometry: beads, masses, curves, a crane; each as its file states it."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement


def brac1() -> OptimalControlProblem:
    """The brachistochrone: the wire on which a bead slides from rest to (2, 2), y downwards, in the least time.

        minimise T   subject to   x' = v sin θ,   y' = v cos θ,   v' = 9.8 cos θ,   0 <= θ <= 2π,   0 <= x, y, v <= 20

    The optimum is a cycloid: T* = 0.824759143.
    """
    ocp = OptimalControlProblem("PSOPT: brac1")

    x = ocp.state("x", lower=0.0, upper=20.0, guess=(0.0, 1.0))  # [m]
    y = ocp.state("y", lower=0.0, upper=20.0, guess=(0.0, 1.0))  # [m]
    v = ocp.state("v", lower=0.0, upper=20.0, guess=(0.0, 1.0))  # [m/s]
    theta = ocp.control("theta", lower=0.0, upper=2.0 * math.pi, guess=1.0)  # [rad]
    T = ocp.free_duration(guess=2.0, lower=1e-3, upper=10.0)  # from 0 in the file

    ocp.minimise(terminal=T)

    ocp.dynamics(x, v * ca.sin(theta))
    ocp.dynamics(y, v * ca.cos(theta))
    ocp.dynamics(v, 9.8 * ca.cos(theta))

    ocp.start(ca.vertcat(x, y, v), 0.0)
    ocp.end(ca.vertcat(x, y), 2.0)
    return ocp


def breakwell() -> OptimalControlProblem:
    """A mass that must not pass a wall at 0.1 m (Breakwell, 1959; Bryson, Denham and Dreyfus, 1963).

        minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   -2 <= x <= 0.1,   |v| <= 2,   |u| <= 10,
                                                 (0, 1) to (0, -1)

    The optimum rests on the wall from 0.3 to 0.7: J* = 4 / (9 · 0.1) = 4.444.
    """
    ocp = OptimalControlProblem("PSOPT: breakwell")

    x = ocp.state("x", lower=-2.0, upper=0.1)  # [m]
    v = ocp.state("v", lower=-2.0, upper=2.0, guess=1.0)  # [m/s]
    u = ocp.control("u", lower=-10.0, upper=10.0)  # [m/s^2]
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))

    ocp.start(ca.vertcat(x, v), [0.0, 1.0])
    ocp.end(ca.vertcat(x, v), [0.0, -1.0])
    return ocp


def bryson_denham() -> OptimalControlProblem:
    """The same mass with the wall at 1/9 m, a cost that is a state, and a duration that is to be found.

        minimise x3(T)   subject to   x1' = x2,   x2' = u,   x3' = u^2 / 2,   0 <= x1 <= 1/9,   |x2|, |x3|, |u| <= 10,
                                      (0, 1, 0) to x1 = 0, x2 = -1,   0 <= T <= 50

    Time on the wall costs nothing, so every T from 6 / 9 on is optimal: J* = 4.
    """
    ocp = OptimalControlProblem("PSOPT: bryson_denham")

    x1 = ocp.state("x1", lower=0.0, upper=1.0 / 9.0)  # [m]
    x2 = ocp.state("x2", lower=-10.0, upper=10.0, guess=(1.0, -1.0))  # [m/s]
    x3 = ocp.state("x3", lower=-10.0, upper=10.0)
    u = ocp.control("u", lower=-10.0, upper=10.0)  # [m/s^2]
    ocp.free_duration(guess=0.5, lower=1e-3, upper=50.0)  # from 0 in the file

    ocp.minimise(terminal=x3)

    ocp.dynamics(ca.vertcat(x1, x2, x3), ca.vertcat(x2, u, u**2 / 2))

    ocp.start(ca.vertcat(x1, x2, x3), [0.0, 1.0, 0.0])
    ocp.end(ca.vertcat(x1, x2), [0.0, -1.0])
    return ocp


def bryson_max_range() -> OptimalControlProblem:
    """A mass that flies as far as it can with a thrust of half its weight (Bryson, Dynamic Optimization, 1999).

        minimise -x(2)   subject to   x' = v u1,   y' = v u2,   v' = 1/2 - u2,   u1^2 + u2^2 = 1,   all within ±10,
                                      (0, 0, 0) to y = 0.1

    (u1, u2) is the direction of flight: J* = -1.7123149.
    """
    ocp = OptimalControlProblem("PSOPT: bryson_max_range")

    x, y, v = (ocp.state(name, lower=-10.0, upper=10.0) for name in ("x", "y", "v"))
    u1 = ocp.control("u1", lower=-10.0, upper=10.0, guess=1.0)
    u2 = ocp.control("u2", lower=-10.0, upper=10.0)
    ocp.duration(2.0)

    ocp.minimise(terminal=-x)

    ocp.dynamics(ca.vertcat(x, y, v), ca.vertcat(v * u1, v * u2, 0.5 - u2))

    ocp.constrain(u1**2 + u2**2 == 1)
    ocp.start(ca.vertcat(x, y, v), 0.0)
    ocp.end(y, 0.1)
    return ocp


def chain() -> OptimalControlProblem:
    """The chain of length 4 that hangs between two points with the least potential energy (COPS 3).

        minimise ∫_0^1 x sqrt(1 + u^2) dt   subject to   x' = u,   ∫_0^1 sqrt(1 + u^2) dt = 4,   |x| <= 10,   |u| <= 20,
                                                         x = 1 to x = 3

    The optimum is a catenary: J* = 5.0684801.
    """
    ocp = OptimalControlProblem("PSOPT: chain")

    x = ocp.state("x", lower=-10.0, upper=10.0, guess=(1.0, 3.0))
    u = ocp.control("u", lower=-20.0, upper=20.0, guess=2.0)
    ocp.duration(1.0)

    stretch = ca.sqrt(1 + u**2)
    ocp.minimise(running=x * stretch)

    ocp.dynamics(x, u)

    ocp.integral(stretch, lower=4.0, upper=4.0)
    ocp.start(x, 1.0)
    ocp.end(x, 3.0)
    return ocp


def coulomb() -> OptimalControlProblem:
    """Two masses with springs and Coulomb friction, moved to rest in the least time (Driessen and Sadegh, 2000).

        minimise T   subject to   1.1 q1'' = -1.8 q1 + 0.85 q2 - s(q1') + u1,   1.2 q2'' = 0.85 (q1 - q2) - s(q2') + u2,
                                  s(v) = tanh(v / 0.01),   |u1|, |u2| <= 4,   |q| <= 2,   |q'| <= 20,   1.8 <= T <= 4,
                                  (q1, q1', q2, q2') = (0, -1, 0, -2) to (1, 0, 2, 0)

    s is the sign of the speed, smoothed; both forces are bang-bang.
    """
    ocp = OptimalControlProblem("PSOPT: coulomb")

    q1 = ocp.state("q1", lower=-2.0, upper=2.0, guess=(0.0, 1.0))  # [m]
    v1 = ocp.state("v1", lower=-20.0, upper=20.0, guess=(-1.0, 0.0))  # [m/s]
    q2 = ocp.state("q2", lower=-2.0, upper=2.0, guess=(0.0, 2.0))  # [m]
    v2 = ocp.state("v2", lower=-20.0, upper=20.0, guess=(-2.0, 0.0))  # [m/s]
    u1, u2 = (ocp.control(name, lower=-4.0, upper=4.0) for name in ("u1", "u2"))  # [N]
    T = ocp.free_duration(guess=4.0, lower=1.8, upper=4.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(ca.vertcat(q1, q2), ca.vertcat(v1, v2))
    ocp.dynamics(v1, (-1.8 * q1 + 0.85 * q2 - ca.tanh(v1 / 0.01) + u1) / 1.1)
    ocp.dynamics(v2, (0.85 * (q1 - q2) - ca.tanh(v2 / 0.01) + u2) / 1.2)

    states = ca.vertcat(q1, v1, q2, v2)
    ocp.start(states, [0.0, -1.0, 0.0, -2.0])
    ocp.end(states, [1.0, 0.0, 2.0, 0.0])
    return ocp


def crane() -> OptimalControlProblem:
    """A container crane that moves its load with the least swing (Teo, Goh and Wong, 1991), over a unit of time.

        minimise 4.5 ∫_0^1 x3^2 + x6^2 dt   subject to   x1' = 9 x4,   x2' = 9 x5,   x3' = 9 x6,
            x4' = 9 (u1 + 17.2656 x3),   x5' = 9 u2,   x6' = -9 (u1 + 27.0756 x3 + 2 x5 x6) / x2,
            |u1| <= 2.83374,   -0.80865 <= u2 <= 0.71265,   |x4| <= 2.5,   |x5| <= 1,   wide bounds of the others,
            (0, 22, 0, 0, -1, 0) to (10, 14, 0, 2.5, 0, 0)

    Both controls enter linearly and cost nothing: J* = 5.1503848e-3.
    """
    ocp = OptimalControlProblem("PSOPT: crane")

    start, end = [0.0, 22.0, 0.0, 0.0, -1.0, 0.0], [10.0, 14.0, 0.0, 2.5, 0.0, 0.0]
    x = ocp.state(
        "x",
        6,
        lower=[-5.0, -5.0, -5.0, -2.5, -1.0, -5.0],
        upper=[15.0, 25.0, 15.0, 2.5, 1.0, 15.0],
        guess=[start, end],
    )
    u = ocp.control("u", 2, lower=[-2.83374, -0.80865], upper=[2.83374, 0.71265])
    ocp.duration(1.0)

    ocp.minimise(running=4.5 * (x[2] ** 2 + x[5] ** 2))

    swing = -(u[0] + 27.0756 * x[2] + 2 * x[4] * x[5]) / x[1]
    ocp.dynamics(x, 9 * ca.vertcat(x[3], x[4], x[5], u[0] + 17.2656 * x[2], u[1], swing))

    ocp.start(x, start)
    ocp.end(x, end)
    return ocp


def dqc() -> OptimalControlProblem:
    """The double integrator, moved by a unit of length in a unit of time with the least energy.

        minimise 1/2 ∫_0^1 u^2 dt   subject to   x' = v,   v' = u,   (0, 0) to (1, 0)

    u = 6 - 12 t: J* = 6.
    """
    ocp = OptimalControlProblem("PSOPT: dqc")

    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
    ocp.duration(1.0)

    ocp.minimise(running=u**2 / 2)

    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))

    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(ca.vertcat(x, v), [1.0, 0.0])
    return ocp


def geodesic() -> OptimalControlProblem:
    """The shortest way from New York to London on a spheroid, in kilometres and hours, at 900 km/h.

        minimise ∫_0^T |p'| dt   subject to   p' = 900 (sin θ cos φ, sin θ sin φ, cos θ),
            (x^2 + y^2) / a^2 + z^2 / b^2 = 1,   a = 6384,   b = 6353,   0 <= θ <= π,   0 <= φ <= 2π,   3 <= T <= 10

    p begins and ends at the angles of latitude and longitude of JFK and LHR, taken as parametric ones: |p'| = 900, so
    J = 900 T.
    """
    V, a, b = 900.0, 6384.0, 6353.0  # [km/h], [km], [km]
    polar = np.radians(90.0 - np.array([40.6413, 51.4700]))  # [rad] of JFK and LHR
    azimuth = np.radians(360.0 - np.array([73.7781, 0.4543]))
    at, along = np.linspace(polar[0], polar[1], 30), np.linspace(azimuth[0], azimuth[1], 30)
    way = np.array([a * np.sin(at) * np.cos(along), a * np.sin(at) * np.sin(along), b * np.cos(at)])  # (3, 30)
    steps = np.diff(way, axis=1)
    steps = np.column_stack([steps, steps[:, -1]])
    lengths = np.linalg.norm(steps, axis=0)
    ocp = OptimalControlProblem("PSOPT: geodesic")

    p = ocp.state("p", 3, lower=[-a, -a, -b], upper=[a, a, b], guess=way.T)  # [km]
    theta = ocp.control("theta", lower=0.0, upper=math.pi, guess=np.arccos(steps[2] / lengths))  # [rad]
    heading = np.arctan2(steps[1], steps[0]) % (2.0 * math.pi)
    phi = ocp.control("phi", lower=0.0, upper=2.0 * math.pi, guess=heading)  # [rad]
    ocp.free_duration(guess=float(lengths[:-1].sum()) / V, lower=3.0, upper=10.0)  # [h]

    speed = V * ca.vertcat(ca.sin(theta) * ca.cos(phi), ca.sin(theta) * ca.sin(phi), ca.cos(theta))
    ocp.minimise(running=ca.norm_2(speed))

    ocp.dynamics(p, speed)

    ocp.constrain((p[0] ** 2 + p[1] ** 2) / a**2 + p[2] ** 2 / b**2 == 1)
    ocp.start(p, way[:, 0])
    ocp.end(p, way[:, -1])
    return ocp


def hypersensitive() -> OptimalControlProblem:
    """The hypersensitive problem: a boundary layer at either end, and nothing in between (Rao and Mease, 2000).

        minimise 1/2 ∫_0^50 x^2 + u^2 dt   subject to   x' = -x^3 + u,   |x|, |u| <= 50,   x = 1.5 to x = 1

    J* = 1.3308069.
    """
    ocp = OptimalControlProblem("PSOPT: hypersensitive")

    x = ocp.state("x", lower=-50.0, upper=50.0, guess=1.0)
    u = ocp.control("u", lower=-50.0, upper=50.0)
    ocp.duration(50.0)

    ocp.minimise(running=(x**2 + u**2) / 2)

    ocp.dynamics(x, -(x**3) + u)

    ocp.start(x, 1.5)
    ocp.end(x, 1.0)
    return ocp


def interior_point() -> MultiPhaseProblem:
    """A state that has to pass a point on its way (Miele and Wang): two phases.

        minimise ∫_0^1 x^2 + u^2 dt   subject to   x' = u,   |x|, |u| <= 1,   x(0) = 1,   x(0.75) = 0.9,   x(1) = 0.75

    On either part x is a sum of e^t and e^-t: J* = 0.9205314.
    """
    problem = MultiPhaseProblem("PSOPT: interior_point")

    ways = [(problem.phase("to the point"), 0.75, (1.0, 0.9)), (problem.phase("from the point"), 0.25, (0.9, 0.75))]
    for phase, duration, guess in ways:
        x = phase.state("x", lower=-1.0, upper=1.0, guess=guess)
        u = phase.control("u", lower=-1.0, upper=1.0)
        phase.duration(duration)
        phase.minimise(running=x**2 + u**2)
        phase.dynamics(x, u)
        phase.end(x, guess[1])
        if duration == 0.75:
            phase.start(x, 1.0)
    problem.link(ways[0][0], ways[1][0])
    return problem


def isoperimetric() -> OptimalControlProblem:
    """A control whose energy is given: an isoperimetric constraint (PROPT).

        minimise ∫_0^1 x dt   subject to   x' = -sin x + u,   ∫_0^1 u^2 dt = 10,   |x| <= 10,   |u| <= 4,
                                           x = 1 to x = 0

    u rests on its lower bound at first: J* = -0.37.
    """
    ocp = OptimalControlProblem("PSOPT: isoperimetric")

    x = ocp.state("x", lower=-10.0, upper=10.0)
    u = ocp.control("u", lower=-4.0, upper=4.0)
    ocp.duration(1.0)

    ocp.minimise(running=x)

    ocp.dynamics(x, -ca.sin(x) + u)

    ocp.integral(u**2, lower=10.0, upper=10.0)
    ocp.start(x, 1.0)
    ocp.end(x, 0.0)
    return ocp


STATEMENTS: dict[str, Statement] = {
    "brac1": brac1,
    "breakwell": breakwell,
    "bryson_denham": bryson_denham,
    "bryson_max_range": bryson_max_range,
    "chain": chain,
    "coulomb": coulomb,
    "crane": crane,
    "dqc": dqc,
    "geodesic": geodesic,
    "hypersensitive": hypersensitive,
    "interior_point": interior_point,
    "isoperimetric": isoperimetric,
}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "brac1": (0.8247591431566, "closed form: a cycloid"),
    "breakwell": (40.0 / 9.0, "closed form: 4 / (9 L)"),
    "bryson_denham": (4.0, "closed form: 4 / (9 L)"),
    "bryson_max_range": (-1.71231487507, "Radau, 40 x 4 and 100 x 3, and Gauss-Legendre, 60 x 3 and 120 x 4"),
    "chain": (5.068480110993, "closed form: a catenary"),
    "coulomb": (2.1142170800, "the four switching times and T by SLSQP, shooting by DOP853 at 1e-12"),
    "crane": (5.1503848e-3, "Radau and Gauss-Legendre on nine arcs, as for the collection's container crane"),
    "dqc": (6.0, "closed form: u = 6 - 12 t"),
    "geodesic": (5549.68185237, "Radau, 40 x 4, and Gauss-Legendre, 60 x 3 and 120 x 4"),
    "hypersensitive": (1.330806904943, "closed form of long durations: two quadratures"),
    "isoperimetric": (-0.3755038114, "Radau and Gauss-Legendre, 240 x 6 and 400 x 5"),
    "interior_point": (0.920531441473, "closed form: ((a^2 + b^2) cosh T - 2 a b) / sinh T of either phase"),
}

DETAILS: dict[str, Details] = {
    "brac1": {"note": "the collection's brachistochrone, with bounds that do not hold at the optimum"},
    "breakwell": {"note": "the collection's Bryson-Denham, L = 0.1, with bounds that do not hold at the optimum"},
    "bryson_denham": {"note": "T is free: every T from 2/3 on is optimal. The printed value is below 4, on 50 nodes"},
    "bryson_max_range": {"note": "the collection's maximum range, with bounds that do not hold at the optimum"},
    "chain": {"note": "the collection's hanging chain, with bounds that do not hold at the optimum"},
    "coulomb": {
        "note": "the printed value has a relative local error of 0.8 % on 40 nodes, says its file of baselines"
    },
    "crane": {"singular": True, "note": "the collection's container crane over a unit of time, with wider bounds"},
    "geodesic": {
        "note": "the printed value is no minimum: its trapezoidal solution has a relative local error of 1.6 %, says "
        "its file of baselines"
    },
    "hypersensitive": {"note": "the collection's hypersensitive, short, with bounds that do not hold at the optimum"},
}
