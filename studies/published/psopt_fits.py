"""Examples of PSOPT that fit the parameters of a differential equation to readings; each as its file states it."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.interfaces.signals import Array
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement
from mathnavi.studies.published.psopt_readings import READINGS


def notorious() -> OptimalControlProblem:
    """Bock's notorious problem: a parameter of an equation that is very unstable (Bock, 1983; Schittkowski, 2002).

        minimise Σ_k (x1(t_k) - y1_k)^2 + (x2(t_k) - y2_k)^2   subject to
            x1' = x2,   x2' = μ^2 x1 - (μ^2 + p^2) sin p t,   μ = 60,   |x1| <= 10,   |x2| <= 100,   |p| <= 10,
            x(0) = (0, π),   0 <= t <= 1

    The readings are sin π t and its rate with noise of 0.05 at 200 random times. As x(0) is given, p misses π by e^-60
    at most; the rest is a linear fit of sinh μ t.
    """
    MU = 60.0
    times, readings = _noisy_readings()
    ocp = OptimalControlProblem("PSOPT: notorious")

    x1 = ocp.state("x1", lower=-10.0, upper=10.0)
    x2 = ocp.state("x2", lower=-100.0, upper=100.0)
    p = ocp.unknown("p", lower=-10.0, upper=10.0)
    ocp.duration(1.0)

    for time, (first, second) in zip(times, readings, strict=True):
        ocp.at(time).minimise((x1 - first) ** 2 + (x2 - second) ** 2)

    ocp.dynamics(x1, x2)
    ocp.dynamics(x2, MU**2 * x1 - (MU**2 + p**2) * ca.sin(p * ocp.t))

    ocp.start(x1, 0.0)
    ocp.start(x2, math.pi)
    return ocp


def _noisy_readings() -> tuple[list[float], Array]:
    """Times (200,) and readings (200, 2), from the file's own random numbers: rand() of glibc from its first seed."""
    COUNT, DEVIATION = 200, 0.05
    words = [1]
    for _ in range(30):
        words.append(16807 * words[-1] % (2**31 - 1))
    words += words[:3]
    while len(words) < 344 + 5 * COUNT:
        words.append((words[-3] + words[-31]) % 2**32)
    uniform = np.array([word >> 1 for word in words[344:]]).reshape(5, COUNT) / (2**31 - 1)
    size = np.sqrt(-2.0 * np.log(uniform[[0, 2]]) + math.sqrt(np.finfo(float).eps))
    noise = DEVIATION * size * np.cos(2.0 * math.pi * uniform[[1, 3]])
    times = np.sort(uniform[4])
    clean = np.column_stack([np.sin(math.pi * times), math.pi * np.cos(math.pi * times)])
    return times.tolist(), clean + noise.T


def param2() -> OptimalControlProblem:
    """Two parameters of a linear equation whose boundary conditions join both ends (Mattheij; Schittkowski, 2002).

        minimise Σ_k |x(t_k) - y_k|^2   subject to   x' = M(p, t) x + e^t f(t),   x(0) + x(π) = 1 + e^π,
            0 <= x, p <= 30,
            M = [[p2 - p1 cos p2 t, 0, p2 + p1 sin p2 t], [0, p1, 0], [p1 sin p2 t - p2, 0, p2 + p1 cos p2 t]],
            f = (19 (cos t - sin t) - 1, -18, 1 - 19 (cos t + sin t)),   0 <= t <= π

    Without noise in the 129 readings of each state it is p = (19, 1), x = e^t. J* = 404.99.
    """
    ocp = OptimalControlProblem("PSOPT: param2")

    x = ocp.state("x", 3, lower=0.0, upper=30.0)
    p1 = ocp.unknown("p1", lower=0.0, upper=30.0, guess=28.5)
    p2 = ocp.unknown("p2", lower=0.0, upper=30.0, guess=1.5)
    ocp.duration(math.pi)
    ocp.guess(x, [[1.0] * 3, [math.exp(math.pi)] * 3])

    for time, *readings in zip(np.linspace(0.0, math.pi, len(READINGS[0])), *READINGS, strict=True):
        ocp.at(float(time)).minimise(ca.sumsqr(x - ca.DM(readings)))

    t = ocp.t
    sin, cos = p1 * ca.sin(p2 * t), p1 * ca.cos(p2 * t)
    force = ca.vertcat(-1 + 19 * (ca.cos(t) - ca.sin(t)), -18, 1 - 19 * (ca.cos(t) + ca.sin(t)))
    homogeneous = ca.vertcat((p2 - cos) * x[0] + (p2 + sin) * x[2], p1 * x[1], (sin - p2) * x[0] + (p2 + cos) * x[2])
    ocp.dynamics(x, homogeneous + ca.exp(t) * force)

    ocp.end_constraint(ocp.initial(x) + x == 1 + math.exp(math.pi))
    return ocp


def predator() -> OptimalControlProblem:
    """Four parameters of the equations of predator and prey, of Lotka and Volterra (Schittkowski, 2002).

        minimise Σ_k |x(k) - y_k|^2   subject to   x1' = -p1 x1 + p2 x1 x2,   x2' = p3 x2 - p4 x1 x2,
                                                   0 <= x <= 3,   -1 <= p <= 5,   x(0) = (0.4, 1),   k = 1 ... 10

    J* = 0.02753.
    """
    FIRST: tuple[float, ...] = (0.58462429, 1.480323792, 1.941197515, 1.266090393, 0.68499583)
    FIRST += (0.435253441, 0.404814065, 0.822427034, 1.771604896, 1.754832745)
    SECOND: tuple[float, ...] = (1.653802752, 1.898433328, 0.791087389, 0.402385741, 0.435968041)
    SECOND += (0.725707829, 1.244405746, 2.052562952, 1.426515341, 0.548344791)
    ocp = OptimalControlProblem("PSOPT: predator")

    x1 = ocp.state("x1", lower=0.0, upper=3.0, guess=0.4)
    x2 = ocp.state("x2", lower=0.0, upper=3.0, guess=1.0)
    p1, p2, p3, p4 = (
        ocp.unknown(f"p{k + 1}", lower=-1.0, upper=5.0, guess=guess) for k, guess in enumerate((0.8, 0.8, 1.5, 1.5))
    )
    ocp.duration(10.0)

    for time, (first, second) in enumerate(zip(FIRST, SECOND, strict=True), start=1):
        ocp.at(float(time)).minimise((x1 - first) ** 2 + (x2 - second) ** 2)

    ocp.dynamics(x1, -p1 * x1 + p2 * x1 * x2)
    ocp.dynamics(x2, p3 * x2 - p4 * x1 * x2)

    ocp.start(x1, 0.4)
    ocp.start(x2, 1.0)
    return ocp


STATEMENTS: dict[str, Statement] = {"notorious": notorious, "param2": param2, "predator": predator}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "notorious": (0.8808548670, "closed form: linear least squares of sinh(μ t) / μ and its rate"),
    "param2": (404.98870333, "Gauss-Legendre and Radau, 256 x 4 and 512 x 4"),
    "predator": (0.027536379, "Gauss-Legendre and Radau, 20 x 4 and 40 x 4"),
}

DETAILS: dict[str, Details] = {
    "notorious": {"note": "the readings follow from the first seed of the C library, not printed by the source"},
}
