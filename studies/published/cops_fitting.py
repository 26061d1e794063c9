"""Fits of COPS 3: rates of reactions, or of growth and death, to readings at given times, by least squares.

Readings, ends and starting values are those of the AMPL models of the report (Dolan, Moré and Munson, 2004): the states
start at the readings, the rates at 0, at 1 for methanol. Time has the unit of the tables, which the report omits.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.interfaces.signals import Array


def _fit(ocp: OptimalControlProblem, y: ca.SX, times: Array, readings: Array) -> None:
    """State the sum of squared errors at the times (k,) of the readings (k, n), and guess the states by these."""
    ocp.duration(float(times[-1]))
    ocp.guess(y, readings, times=times.tolist())
    for time, reading in zip(times, readings, strict=True):
        ocp.at(float(time)).minimise(ca.sumsqr(y - reading))


PINENE_TIMES = np.array([1230.0, 3060.0, 4920.0, 7800.0, 10680.0, 15030.0, 22620.0, 36420.0])
PINENE = np.array(
    [
        [88.35, 7.3, 2.3, 0.4, 1.75], [76.4, 15.6, 4.5, 0.7, 2.8], [65.1, 23.1, 5.3, 1.1, 5.8],
        [50.4, 32.9, 6.0, 1.5, 9.3], [37.5, 42.7, 6.0, 1.9, 12.0], [25.9, 49.1, 5.9, 2.2, 17.0],
        [14.0, 57.4, 5.1, 2.6, 21.0], [4.5, 63.1, 3.8, 2.9, 25.7],
    ]
)  # fmt: skip


def pinene() -> OptimalControlProblem:
    """Isomerisation of α-pinene: five rates from eight readings of five concentrations (COPS 3, problem 5).

    minimise Σ_j |y(τ_j) - z_j|^2   subject to   y1' = -(θ1 + θ2) y1,   y2' = θ1 y1,
        y3' = θ2 y1 - (θ3 + θ4) y3 + θ5 y5,   y4' = θ3 y3,   y5' = θ4 y3 - θ5 y5,   θ >= 0,   y(0) = (100, 0, 0, 0, 0)
    """
    ocp = OptimalControlProblem("pinene")
    y = ocp.state("y", 5)  # [%]
    theta = ocp.unknown("theta", 5, lower=0.0)
    start = np.array([100.0, 0.0, 0.0, 0.0, 0.0])

    ocp.dynamics(
        y,
        ca.vertcat(
            -(theta[0] + theta[1]) * y[0],
            theta[0] * y[0],
            theta[1] * y[0] - (theta[2] + theta[3]) * y[2] + theta[4] * y[4],
            theta[2] * y[2],
            theta[3] * y[2] - theta[4] * y[4],
        ),
    )
    _fit(ocp, y, PINENE_TIMES, PINENE)
    ocp.guess(y, np.vstack([start, PINENE]), times=[0.0, *PINENE_TIMES.tolist()])
    ocp.start(y, start)
    return ocp


MARINE_TIMES = np.linspace(0.0, 10.0, 21)
MARINE = np.array(
    [
        [20000, 17000, 10000, 15000, 12000, 9000, 7000, 3000], [12445, 15411, 13040, 13338, 13484, 8426, 6615, 4022],
        [7705, 13074, 14623, 11976, 12453, 9272, 6891, 5020], [4664, 8579, 12434, 12603, 11738, 9710, 6821, 5722],
        [2977, 7053, 11219, 11340, 13665, 8534, 6242, 5695], [1769, 5054, 10065, 11232, 12112, 9600, 6647, 7034],
        [943, 3907, 9473, 10334, 11115, 8826, 6842, 7348], [581, 2624, 7421, 10297, 12427, 8747, 7199, 7684],
        [355, 1744, 5369, 7748, 10057, 8698, 6542, 7410], [223, 1272, 4713, 6869, 9564, 8766, 6810, 6961],
        [137, 821, 3451, 6050, 8671, 8291, 6827, 7525], [87, 577, 2649, 5454, 8430, 7411, 6423, 8388],
        [49, 337, 2058, 4115, 7435, 7627, 6268, 7189], [32, 228, 1440, 3790, 6474, 6658, 5859, 7467],
        [17, 168, 1178, 3087, 6524, 5880, 5562, 7144], [11, 99, 919, 2596, 5360, 5762, 4480, 7256],
        [7, 65, 647, 1873, 4556, 5058, 4944, 7538], [4, 44, 509, 1571, 4009, 4527, 4233, 6649],
        [2, 27, 345, 1227, 3677, 4229, 3805, 6378], [1, 20, 231, 934, 3197, 3695, 3159, 6454],
        [1, 12, 198, 707, 2562, 3163, 3232, 5566],
    ],
    dtype=float,
)  # fmt: skip


def marine() -> OptimalControlProblem:
    """A marine population in eight stages: rates of growth g and death m from 21 counts of each (COPS 3, problem 6).

    minimise Σ_j |y(τ_j) - z_j|^2   subject to   y_s' = g_(s-1) y_(s-1) - (m_s + g_s) y_s,   g_0 = g_8 = 0,
                                                 g, m >= 0,   y(0) free
    """
    ocp = OptimalControlProblem("marine")
    y = ocp.state("y", 8)  # individuals
    g = ocp.unknown("g", 7, lower=0.0)
    m = ocp.unknown("m", 8, lower=0.0)

    grown = ca.vertcat(g * y[:7], 0.0)
    ocp.dynamics(y, ca.vertcat(0.0, g * y[:7]) - grown - m * y)
    _fit(ocp, y, MARINE_TIMES, MARINE)
    return ocp


GASOIL_TIMES = np.array(
    [
        0.0, 0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175, 0.2, 0.225, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.65,
        0.75, 0.85, 0.95,
    ]
)  # fmt: skip
GASOIL = np.array(
    [
        [1.0, 0.0], [0.8105, 0.2], [0.6208, 0.2886], [0.5258, 0.301], [0.4345, 0.3215], [0.3903, 0.3123],
        [0.3342, 0.2716], [0.3034, 0.2551], [0.2735, 0.2258], [0.2405, 0.1959], [0.2283, 0.1789], [0.2071, 0.1457],
        [0.1669, 0.1198], [0.153, 0.0909], [0.1339, 0.0719], [0.1265, 0.0561], [0.12, 0.046], [0.099, 0.028],
        [0.087, 0.019], [0.077, 0.014], [0.069, 0.01],
    ]
)  # fmt: skip


def gasoil() -> OptimalControlProblem:
    """Catalytic cracking of gas oil: three rates from 21 readings of two concentrations (COPS 3, problem 12).

    minimise Σ_j |y(τ_j) - z_j|^2   subject to   y1' = -(θ1 + θ3) y1^2,   y2' = θ1 y1^2 - θ2 y2,
                                                 θ >= 0,   y(0) = (1, 0)
    """
    ocp = OptimalControlProblem("gasoil")
    y = ocp.state("y", 2)
    theta = ocp.unknown("theta", 3, lower=0.0)

    ocp.dynamics(y, ca.vertcat(-(theta[0] + theta[2]) * y[0] ** 2, theta[0] * y[0] ** 2 - theta[1] * y[1]))
    _fit(ocp, y, GASOIL_TIMES, GASOIL)
    ocp.start(y, [1.0, 0.0])
    return ocp


METHANOL_TIMES = np.array(
    [
        0.0, 0.05, 0.065, 0.08, 0.123, 0.233, 0.273, 0.354, 0.397, 0.418, 0.502, 0.553, 0.681, 0.75, 0.916, 0.937,
        1.122,
    ]
)  # fmt: skip
METHANOL = np.array(
    [
        [1.0, 0.0, 0.0], [0.7085, 0.1621, 0.0811], [0.5971, 0.1855, 0.0965], [0.5537, 0.1989, 0.1198],
        [0.3684, 0.2845, 0.1535], [0.1712, 0.3491, 0.2097], [0.1198, 0.3098, 0.2628], [0.0747, 0.3576, 0.2467],
        [0.0529, 0.3347, 0.2884], [0.0415, 0.3388, 0.2757], [0.0261, 0.3557, 0.3167], [0.0208, 0.3483, 0.2954],
        [0.0085, 0.3836, 0.295], [0.0053, 0.3611, 0.2937], [0.0019, 0.3609, 0.2831], [0.0018, 0.3485, 0.2846],
        [0.0006, 0.3698, 0.2899],
    ]
)  # fmt: skip


def methanol() -> OptimalControlProblem:
    """Methanol to hydrocarbons: five rates from 17 readings of three concentrations (COPS 3, problem 13).

    minimise Σ_j |y(τ_j) - z_j|^2   subject to   θ >= 0,   y(0) = (1, 0, 0),   N = (θ2 + θ5) y1 + y2,
        y1' = -(2 θ2 - θ1 y2 / N + θ3 + θ4) y1,   y2' = θ1 y1 (θ2 y1 - y2) / N + θ3 y1,
        y3' = θ1 y1 (y2 + θ5 y1) / N + θ4 y1
    """
    ocp = OptimalControlProblem("methanol")
    y = ocp.state("y", 3)
    theta = ocp.unknown("theta", 5, lower=0.0, guess=1.0)

    N = (theta[1] + theta[4]) * y[0] + y[1]
    ocp.dynamics(
        y,
        ca.vertcat(
            -(2 * theta[1] - theta[0] * y[1] / N + theta[2] + theta[3]) * y[0],
            theta[0] * y[0] * (theta[1] * y[0] - y[1]) / N + theta[2] * y[0],
            theta[0] * y[0] * (y[1] + theta[4] * y[0]) / N + theta[3] * y[0],
        ),
    )
    _fit(ocp, y, METHANOL_TIMES, METHANOL)
    ocp.start(y, [1.0, 0.0, 0.0])
    return ocp
