"""Is Q = 0 on the truth, and is each feed-forward Psi_* F there? Held against derivatives that are not theirs.

The rates of rho and s are taken by a complex step through the ray itself: with x(t + ih) = x + ih F(x, u), the ray
solves q_1^2 + q_2^2 = 1 for q = (p_1 / c_1, p_2 / c_2) at p = (x_1, x_2) + rho e. The imaginary parts over h are the
derivatives, to round-off, and s' = q_1 q_2' - q_2 q_1' as q = (cos s, sin s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.ranging.feedforward_kernels import LEAST_DENOMINATOR, rho_dot_rate, s_rate
from mathnavi.estimators.ranging.observer import FEED_FORWARDS
from mathnavi.estimators.ranging.symbolic_output_flow import output_flow
from mathnavi.models.angles import wrapped
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.ranging.observability.maps import HALF_AXES, SENSORS, STANDARD

FASTEST = (1.0, 2.0)  # [m/s, rad/s] of an input that is drawn, either way
PERIOD = 0.01  # [s]
_STEP = 1e-30  # [s]


@dataclass(frozen=True)
class Identities:
    """Residuals on the truth at one state, under one input."""

    sensors: str
    Q: float  # |Q| [m^2/s], as printed
    s: float  # [rad/s] the largest component by which the rate is off Psi_* F; NaN where the denominator is guarded
    rho_dot: float  # [rad/s] likewise
    manifold: float  # [rad] by which z is off Psi(x) after a period
    heun_s: float  # [rad] likewise: what the integration of s over a period leaves
    heun_rho_dot: float  # [rad]


def identities(asked: tuple[str, int, int]) -> list[Identities]:
    """Residuals at a number of states that a seed draws: (name of the sensors, seed, states)."""
    sensors, seed, states = asked
    rng = np.random.default_rng(seed)
    return [_at(sensors, STANDARD.draw(rng, 0.05), rng.uniform(-1.0, 1.0, 2) * FASTEST) for _ in range(states)]


def _at(sensors: str, x: Array, u: Array) -> Identities:
    alpha = np.radians(SENSORS[sensors])
    table, wall = STANDARD.table, STANDARD.wall
    rho, s = STANDARD.ranges(x, alpha)
    rho_dot, s_dot = complex_step(x, u, alpha)
    z, rate = np.append(s, x[2]), np.append(s_dot, u[1])
    Q, _ = output_flow(STANDARD, tuple(alpha.tolist()))(z, rho, rho_dot, u)
    after = integrate(x, u[0], u[1], PERIOD)
    is_clear = _least_denominator(x, alpha) >= LEAST_DENOMINATOR
    ends = dict.fromkeys(FEED_FORWARDS, math.nan)
    if is_clear and STANDARD.contains(after[:2]) and _least_denominator(after, alpha) >= LEAST_DENOMINATOR:
        z_after = np.append(STANDARD.ranges(after, alpha)[1], after[2])
        there = np.stack([STANDARD.ranges(after, alpha)[0], complex_step(after, u, alpha)[0]])
        for name, forward in FEED_FORWARDS.items():
            reached = forward(wall, alpha, z, np.stack([rho, rho_dot]), there, u, PERIOD)
            error = wrapped(reached - z_after)
            ends[name] = float(np.abs(error).max())
    return Identities(
        sensors,
        float(np.linalg.norm(np.array(Q))),
        float(np.abs(s_rate(table, alpha, z, rho, u) - rate).max()) if is_clear else math.nan,
        float(np.abs(rho_dot_rate(table, alpha, z, rho, rho_dot, u) - rate).max()) if is_clear else math.nan,
        ends["manifold"],
        ends["s"],
        ends["rho_dot"],
    )


def complex_step(x: Array, u: Array, alpha: Array) -> tuple[Array, Array]:
    """rho' (l,) [m/s] and s' (l,) [rad/s] of the rays of a pose x (3,) that moves with u (2,)."""
    c = np.array(HALF_AXES)
    phi = x[2] + 1j * _STEP * u[1]
    p = (x[:2] + 1j * _STEP * u[0] * np.array([math.cos(x[2]), math.sin(x[2])])) / c
    e = np.stack([np.cos(phi + alpha), np.sin(phi + alpha)], axis=1) / c  # (l, 2)
    a, b = np.square(e).sum(axis=1), (e * p).sum(axis=1)
    rho = (-b + np.sqrt(b * b - a * (np.square(p).sum() - 1.0))) / a
    q = p + rho[:, None] * e
    q_dot = q.imag / _STEP
    return rho.imag / _STEP, q[:, 0].real * q_dot[:, 1] - q[:, 1].real * q_dot[:, 0]


def _least_denominator(x: Array, alpha: Array) -> float:
    """[m] |theta'(s)' R_{phi + alpha} e_2|, the least of all rays."""
    _, s = STANDARD.ranges(x, alpha)
    tangent, beta = STANDARD.tangent(s), x[2] + alpha
    return float(np.abs(tangent[:, 1] * np.cos(beta) - tangent[:, 0] * np.sin(beta)).min())
