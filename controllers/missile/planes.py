"""The pitch plane and the yaw plane of a flight in space: how a motion is split into two, and joined.

Seen from the frame R_y(theta), which pitches with the missile but does not yaw, velocity and force are

    (U, V, w) = R_z(psi) (u, v, w),        (F_1, F_2, F_z) = R_z(psi) (F_x, F_y, F_z),

and with a = theta'', b = psi'' and q for theta' the equations of motion are

    pitch:  U' = F_1 / m - q w - g sin theta,   w' = F_z / m + q U + g cos theta,   q' = a,   theta' = q,
            x_e' = U cos theta + w sin theta,   z_e' = -U sin theta + w cos theta;
    yaw:    V' = F_2 / m,   r' = b,   psi' = r,   y_e' = V.

The first are those of the thesis' pitch plane (B.4) with (F_1, F_z, I_y a) for (F_x, F_z, M), the second are linear,
and neither holds a variable of the other: motions planned in each fly together exactly as planned. The planes meet in
the inputs alone, A and A_psi as in ``mathnavi.models.missile.dynamics``,

    F_x = F_1 cos psi + F_2 sin psi,   F_y = F_2 cos psi - F_1 sin psi,
    M = (A a + A_psi r q) / cos psi,   N = I_z b - A_psi q^2 / 2,

and so in the cost and in the limits.

**Their problems.** Each planner minimises the same J with the other's motion held: motions enter a problem as known
functions of time, Legendre series in τ = t / T whose coefficients are parameters,

    f(τ) = Σ_n c_n P_n(2 τ - 1),      (n + 1) P_(n+1)(s) = (2 n + 1) s P_n(s) - n P_(n-1)(s),

fitted by least squares to what the other problem found at its nodes or held between them (see ``pitch_and_yaw``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from mathnavi.controllers.missile.problem import (
    DURATIONS,
    STATE_LIMITS,
    STATE_SCALES,
    TYPICAL_DURATION,
    declared_weights,
    input_scales,
    keep_above_ground,
)
from mathnavi.controllers.missile.shooting import CLOCK, Solved
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import running_cost

DEGREE = 8
"""degree of the Legendre series"""

PITCH = PLANAR.states
YAW = ("V", "r", "psi", "y_e")

Limits = tuple[float, float, float, float, float]
"""limits of F_x, F_y, F_z [N], M, N [N m]"""


def split(x: Array) -> tuple[Array, Array]:
    """States (..., 6) in the pitch plane and (..., 4) in the yaw plane of spatial states (..., 10)."""
    u, v, w, q, r, theta, psi, x_e, y_e, z_e = np.moveaxis(x, -1, 0)
    c, s = np.cos(psi), np.sin(psi)
    pitch = np.stack([u * c - v * s, w, q / c, theta, x_e, z_e], axis=-1)
    return pitch, np.stack([u * s + v * c, r, psi, y_e], axis=-1)


def joined(pitch: Array, yaw: Array) -> Array:
    """Spatial states (..., 10) from both planes' states, (..., 6) and (..., 4): the inverse of ``split``."""
    U, w, q, theta, x_e, z_e = np.moveaxis(pitch, -1, 0)
    V, r, psi, y_e = np.moveaxis(yaw, -1, 0)
    c, s = np.cos(psi), np.sin(psi)
    return np.stack([U * c + V * s, V * c - U * s, w, q * c, r, theta, psi, x_e, y_e, z_e], axis=-1)


def inputs_between(pitch: Solved, yaw: Solved, parts: int, body: Body) -> tuple[Array, Array]:
    """Breaks (K + 1,) [s] that divide each interval of a common grid into ``parts``, and spatial inputs (K, 5) to hold
    between them.

    ``pitch`` holds (F_1, F_z, I_y a) over each interval and ``yaw`` holds (F_2, I_z b). Along the body's axes these
    forces are not constant, for the body turns: each part holds the result of the inverse dynamics in its middle.
    """
    m, inertia = body.mass, body.inertia
    width = np.repeat(np.diff(pitch.times), parts) / parts
    since = (np.tile(np.arange(parts), len(pitch.u)) + 0.5) * width
    F_1, F_z, pitching = np.repeat(pitch.u, parts, axis=0).T
    F_2, yawing = np.repeat(yaw.u, parts, axis=0).T
    q_0, theta_0 = np.repeat(pitch.x[:-1, 2:4], parts, axis=0).T
    r_0, psi_0 = np.repeat(yaw.x[:-1, 1:3], parts, axis=0).T
    a, b = pitching / inertia, yawing / inertia
    q, theta = q_0 + a * since, theta_0 + (q_0 + 0.5 * a * since) * since
    r, psi = r_0 + b * since, psi_0 + (r_0 + 0.5 * b * since) * since
    attitude = np.zeros((len(since), SPATIAL.state_size))  # the inverse dynamics need no more of a state
    attitude[:, 3:7] = np.column_stack([q * np.cos(psi), r, theta, psi])
    c, s = np.cos(theta), np.sin(theta)
    # Accelerations of MuJoCo's joints (x, y, z, theta, psi): x ahead, y to the left, z up.
    joints = np.column_stack([(F_1 * c + F_z * s) / m, -F_2 / m, (F_1 * s - F_z * c) / m - body.gravity, a, b])
    breaks = np.concatenate([[0.0], np.cumsum(width)])
    return breaks, SPATIAL.inverse_dynamics(attitude, joints, body)


@lru_cache(maxsize=16)
def pitch_problem(body: Body, limits: Limits) -> ProblemFunctions:
    """The pitch planner's problem in τ; the series psi, B and B' hold the yaw motion.

    Its parameters are ``WEIGHTS``, the series, V_0, v_y, the start, x_e and z_e at the end with their rates, theta, w,
    and ``GROUND``.
    """
    m = body.mass
    ocp = OptimalControlProblem("missile, pitch beside yaw")
    cost = declared_weights(ocp)
    scales = input_scales(body)
    x = {}
    for name in PITCH:
        lower, upper = STATE_LIMITS.get(name, (-math.inf, math.inf))
        x[name] = ocp.state(name, lower=lower, upper=upper, scale=STATE_SCALES.get(name, 1.0))
    T = ocp.state(CLOCK, lower=DURATIONS[0], upper=DURATIONS[1], scale=TYPICAL_DURATION, guess=(TYPICAL_DURATION,))
    axial, _, normal, moment, _ = limits
    F_1, F_z, pitching = (
        ocp.control(name, lower=-limit, upper=limit, scale=scales[name])
        for name, limit in zip(PLANAR.inputs, (axial, normal, moment), strict=True)
    )
    held = [declared_series(ocp, name) for name in ("psi", "B", "B'")]
    V_0, v_y = ocp.parameter("V_0", 0.0), ocp.parameter("v_y", 0.0)
    ocp.duration(1.0)

    psi, B, B_rate = (series(c, ocp.t) for c in held)
    A, A_rate = lateral_baseline(ocp.t, V_0, v_y)
    V, F_2 = A + B / T, m * (A_rate / T + B_rate / T**2)
    c, s = ca.cos(psi), ca.sin(psi)
    U = x["u"]
    velocity = (U * c + V * s, V * c - U * s, x["w"])
    force = (F_1 * c + F_2 * s, F_2 * c - F_1 * s, F_z)
    ocp.minimise(running=T * running_cost(cost, body, velocity, force, (pitching * c) ** 2))

    rates = PLANAR.dynamics(body)(ca.vertcat(*x.values()), ca.vertcat(F_1, F_z, pitching))
    for state, rate in zip(x.values(), ca.vertsplit(rates), strict=True):
        ocp.dynamics(state, T * rate)
    ocp.dynamics(T, 0.0)
    for name, state in x.items():
        ocp.start(state, ocp.parameter(f"start_{name}", 0.0))
    ahead = []
    for name in ("x_e", "z_e"):
        end, rate = ocp.parameter(f"end_{name}", 0.0), ocp.parameter(f"end_rate_{name}", 0.0)
        ocp.end(x[name], end + rate * T)
        ahead.append(x[name] - end - rate * T * ocp.t)
    for name in ("theta", "w"):
        ocp.end(x[name], ocp.parameter(f"end_{name}", 0.0))
    keep_above_ground(ocp, x["z_e"], ahead[:1], T * ocp.t)
    return ocp.functions()


@lru_cache(maxsize=16)
def yaw_problem(body: Body, limits: Limits) -> ProblemFunctions:
    """The yaw planner's problem in τ; T and the series U and F_1 hold the pitch motion.

    Its parameters are ``WEIGHTS``, T, the series, the start, and V, psi, y_e at the end. It also keeps the forces along
    the missile's axes within their limits.
    """
    m, I_z = body.mass, body.inertia
    ocp = OptimalControlProblem("missile, yaw beside pitch")
    cost = declared_weights(ocp)
    scales, scale = input_scales(body), {"V": STATE_SCALES["v"], **STATE_SCALES}
    x = {}
    for name in YAW:
        lower, upper = STATE_LIMITS.get(name, (-math.inf, math.inf))
        x[name] = ocp.state(name, lower=lower, upper=upper, scale=scale.get(name, 1.0))
    V, r, psi, _ = x.values()
    axial, lateral, _, _, moment = limits
    F_2 = ocp.control("F_y", lower=-lateral, upper=lateral, scale=scales["F_y"])
    yawing = ocp.control("N", lower=-moment, upper=moment, scale=scales["N"])
    T = ocp.parameter("T", TYPICAL_DURATION)
    U, F_1 = (series(declared_series(ocp, name), ocp.t) for name in ("U", "F_1"))
    ocp.duration(1.0)

    c, s = ca.cos(psi), ca.sin(psi)
    none = ca.SX(0)
    F_x, F_y = F_1 * c + F_2 * s, F_2 * c - F_1 * s
    ocp.minimise(
        running=T * running_cost(cost, body, (U * c + V * s, V * c - U * s, none), (F_x, F_y, none), yawing**2)
    )
    for component, limit in ((F_x, axial), (F_y, lateral)):
        if math.isfinite(limit):
            ocp.constrain(component / limit, lower=-1.0, upper=1.0)

    for state, rate in zip(x.values(), (F_2 / m, yawing / I_z, r, V), strict=True):
        ocp.dynamics(state, T * rate)
    for name, state in x.items():
        ocp.start(state, ocp.parameter(f"start_{name}", 0.0))
    for name in ("V", "psi", "y_e"):
        ocp.end(x[name], ocp.parameter(f"end_{name}", 0.0))
    return ocp.functions()


def lateral_baseline(tau: Any, V_0: Any, v_y: Any) -> tuple[Any, Any]:
    """A and A' of V = A + B / T (see ``pitch_and_yaw``) at fractions tau of the flight, numbers or expressions."""
    A = V_0 * (1 - 4 * tau + 3 * tau**2) + v_y * (6 * tau - 6 * tau**2)
    return A, V_0 * (6 * tau - 4) + v_y * (6 - 12 * tau)


def declared_series(ocp: OptimalControlProblem, name: str) -> list[ca.SX]:
    """Declare the coefficients of one function as parameters of a problem."""
    return [ocp.parameter(f"{name}_{n}", 0.0) for n in range(DEGREE + 1)]


def series(c: Sequence[ca.SX], tau: ca.SX) -> ca.SX:
    """Value f(τ) of a Legendre series with coefficients c."""
    s = 2 * tau - 1
    before, basis = ca.SX(1), s
    total = c[0] + c[1] * s
    for n in range(1, DEGREE):
        before, basis = basis, ((2 * n + 1) * s * basis - n * before) / (n + 1)
        total += c[n + 1] * basis
    return total


def fitted(tau: Array, values: Sequence[Array]) -> Array:
    """Coefficients, one function after the other, of functions with the values (n,) given at fractions tau (n,)."""
    basis = legendre.legvander(2.0 * tau - 1.0, DEGREE)
    coefficients, *_ = np.linalg.lstsq(basis, np.column_stack(values), rcond=None)
    return np.asarray(coefficients.T.ravel())
