"""What the pitch planner and the yaw planner minimise, each with the other's motion held (see ``pitch_and_yaw``)."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import casadi as ca

from mathnavi.controllers.missile.planes import PITCH, YAW
from mathnavi.controllers.missile.problem import (
    DURATIONS,
    STATE_LIMITS,
    STATE_SCALES,
    TYPICAL_DURATION,
    declared_weights,
    input_scales,
    running_cost,
)
from mathnavi.controllers.missile.profile import declare, series
from mathnavi.controllers.missile.shooting import CLOCK
from mathnavi.controllers.ocp.statement import OptimalControlProblem, Statement
from mathnavi.models.missile.coordinates import PLANAR
from mathnavi.models.missile.dynamics import Body

Limits = tuple[float, float, float, float, float]
"""of F_x, F_y, F_z [N], M, N [N m]"""


@lru_cache(maxsize=16)
def pitch_problem(body: Body, limits: Limits) -> OptimalControlProblem:
    """The pitch planner's problem in τ; what it holds of the yaw motion are the series psi, B and B'.

    Its parameters are ``WEIGHTS``, the series, V_0, v_y, the start, x_e and z_e at the end with their rates, theta, w.
    """
    m = body.mass
    ocp = Statement("missile, pitch beside yaw")
    cost = declared_weights(ocp)
    scales = input_scales(body)
    x = {}
    for name in PITCH:
        lower, upper = STATE_LIMITS.get(name, (-math.inf, math.inf))
        x[name] = ocp.state(name, lower=lower, upper=upper, scale=STATE_SCALES.get(name, 1.0))
    T = ocp.state(CLOCK, lower=DURATIONS[0], upper=DURATIONS[1], scale=TYPICAL_DURATION, guess=(TYPICAL_DURATION,))
    axial, _, normal, moment, _ = limits
    F_1, F_z, turn = (
        ocp.control(name, lower=-limit, upper=limit, scale=scales[name])
        for name, limit in zip(PLANAR.inputs, (axial, normal, moment), strict=True)
    )
    held = [declare(ocp, name) for name in ("psi", "B", "B'")]
    V_0, v_y = ocp.parameter("V_0", 0.0), ocp.parameter("v_y", 0.0)
    ocp.duration(1.0)

    psi, B, B_rate = (series(c, ocp.t) for c in held)
    A, A_rate = lateral_baseline(ocp.t, V_0, v_y)
    V, F_2 = A + B / T, m * (A_rate / T + B_rate / T**2)
    c, s = ca.cos(psi), ca.sin(psi)
    U = x["u"]
    velocity = (U * c + V * s, V * c - U * s, x["w"])
    force = (F_1 * c + F_2 * s, F_2 * c - F_1 * s, F_z)
    ocp.minimise(running=T * running_cost(cost, body, velocity, force, (turn * c) ** 2))

    rates = PLANAR.dynamics(body)(ca.vertcat(*x.values()), ca.vertcat(F_1, F_z, turn))
    for state, rate in zip(x.values(), ca.vertsplit(rates), strict=True):
        ocp.dynamics(state, T * rate)
    ocp.dynamics(T, 0.0)
    for name, state in x.items():
        ocp.start(state, ocp.parameter(f"start_{name}", 0.0))
    for name in ("x_e", "z_e"):
        ocp.end(x[name], ocp.parameter(f"end_{name}", 0.0) + ocp.parameter(f"end_rate_{name}", 0.0) * T)
    for name in ("theta", "w"):
        ocp.end(x[name], ocp.parameter(f"end_{name}", 0.0))
    return ocp.problem()


@lru_cache(maxsize=16)
def yaw_problem(body: Body, limits: Limits) -> OptimalControlProblem:
    """The yaw planner's problem in τ; what it holds of the pitch motion are T and the series U and F_1.

    Its parameters are ``WEIGHTS``, T, the series, the start, and V, psi, y_e at the end. It also keeps the forces along
    the missile's axes within their limits.
    """
    m, I_z = body.mass, body.inertia
    ocp = Statement("missile, yaw beside pitch")
    cost = declared_weights(ocp)
    scales, scale = input_scales(body), {"V": STATE_SCALES["v"], **STATE_SCALES}
    x = {}
    for name in YAW:
        lower, upper = STATE_LIMITS.get(name, (-math.inf, math.inf))
        x[name] = ocp.state(name, lower=lower, upper=upper, scale=scale.get(name, 1.0))
    V, r, psi, _ = x.values()
    axial, lateral, _, _, moment = limits
    F_2 = ocp.control("F_y", lower=-lateral, upper=lateral, scale=scales["F_y"])
    swing = ocp.control("N", lower=-moment, upper=moment, scale=scales["N"])
    T = ocp.parameter("T", TYPICAL_DURATION)
    U, F_1 = (series(declare(ocp, name), ocp.t) for name in ("U", "F_1"))
    ocp.duration(1.0)

    c, s = ca.cos(psi), ca.sin(psi)
    none = ca.SX(0)
    F_x, F_y = F_1 * c + F_2 * s, F_2 * c - F_1 * s
    ocp.minimise(running=T * running_cost(cost, body, (U * c + V * s, V * c - U * s, none), (F_x, F_y, none), swing**2))
    for force, limit in ((F_x, axial), (F_y, lateral)):
        if math.isfinite(limit):
            ocp.constrain(force / limit, lower=-1.0, upper=1.0)

    for state, rate in zip(x.values(), (F_2 / m, swing / I_z, r, V), strict=True):
        ocp.dynamics(state, T * rate)
    for name, state in x.items():
        ocp.start(state, ocp.parameter(f"start_{name}", 0.0))
    for name in ("V", "psi", "y_e"):
        ocp.end(x[name], ocp.parameter(f"end_{name}", 0.0))
    return ocp.problem()


def lateral_baseline(tau: Any, V_0: Any, v_y: Any) -> tuple[Any, Any]:
    """A and A' of V = A + B / T (see ``pitch_and_yaw``) at fractions tau of the flight, of numbers or symbols."""
    A = V_0 * (1 - 4 * tau + 3 * tau**2) + v_y * (6 * tau - 6 * tau**2)
    return A, V_0 * (6 * tau - 4) + v_y * (6 - 12 * tau)
