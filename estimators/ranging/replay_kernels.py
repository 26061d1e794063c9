"""Replay of the last readings on the way to a pose, compiled: does odometry lead there through these ranges?

A filter that is at a wrong pose may follow the readings for seconds: each update moves it, and so does the slip that it
finds. The replay does not move. With x the estimate, odometry leads back from it to the poses x_k of the last readings,
and all residuals depend on one error d (3,) of x, turned and moved with the robot as a rigid body,

    nu_ki = rho_ki - h_i(x_k) = J_ki d_k + noise,   J_ki = (H_1, H_2, H_3 + H_2 (x_1k - x_1) - H_1 (x_2k - x_2)),

where d_k is a random walk: odometry and slip add w to the place and w_phi to the heading at x_k,

    d_{k+1} = d_k + (w_1 + w_phi (x_2k - x_2), w_2 - w_phi (x_1k - x_1), w_phi).

A Kalman filter that knows nothing at first finds d and its covariance from the readings alone, whatever the estimator
has been told before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from mathnavi.estimators.ranging.bank_kernels import BY_HEADING, SENSORS, WALL
from mathnavi.estimators.ranging.kalman_kernels import RaySensors, expected_range, step_within
from mathnavi.estimators.ranging.last_readings import Way
from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.kernel_types import ONE, TWO, named
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, is_inside
from mathnavi.models.unicycle.kernels import integrate, wrapped

_STEPS, _LONGEST, _LAST = 6, 1.0, 1e-3  # of a fit, its longest [m, rad], and the one that ends it
_NOTHING = 1e4  # [m^2, rad^2] variance of d before the first reading


class Reckoning(NamedTuple):
    """Errors of dead reckoning."""

    W: Array  # (2,) [m^2/s^2, rad^2/s^2] variances of an input
    scale: float  # variance of the scale error x_4
    slip: float  # [m^2/s] intensity of the process noise of slip


class Fit(NamedTuple):
    """Result of a replay."""

    rays: int  # number of ranges that were compared
    beyond: int  # of them: beyond the gate, or from a pose beyond the wall
    nis: float  # sum over the others
    d: Array  # (3,) [m, m, rad] error of the pose
    P: Array  # (3, 3) covariance of d


@njit(cache=True, nogil=True)
def replay(x: Array, way: Way, wall: WallShape, sensors: RaySensors, reckoning: Reckoning) -> Fit:
    """Fit d to the ranges on the way to x (4,)."""
    ranges, inputs, times = way
    W, scale, slip = reckoning
    n, (coefficients, polyline) = len(times), wall
    poses, ways, turns = np.empty((n, 3)), np.zeros(n), np.zeros(n)
    poses[n - 1] = x[:3]
    for k in range(n - 1, 0, -1):
        dt = times[k] - times[k - 1]
        u_1, u_2 = (1.0 - x[3]) * inputs[k, 0], (1.0 - x[3]) * inputs[k, 1]
        poses[k - 1] = integrate(poses[k], u_1, u_2, -dt)
        ways[k - 1], turns[k - 1] = ways[k] + abs(u_1) * dt, turns[k] + abs(u_2) * dt
    d, P, PJ = np.zeros(3), _NOTHING * np.eye(3), np.empty(3)
    H, D, J, b = np.empty(3), np.empty(3), np.empty(3), np.ones(3)
    rays, beyond, nis = 0, 0, 0.0
    for k in range(n):
        if k > 0:
            dt = times[k] - times[k - 1]
            q, q_phi = W[0] * dt * dt + slip * dt, W[1] * dt * dt + slip * dt * BY_HEADING**2
            b[0], b[1] = poses[k, 1] - x[1], x[0] - poses[k, 0]
            for i in range(3):
                P[i, i] += q if i < 2 else 0.0
                for j in range(3):
                    P[i, j] += q_phi * b[i] * b[j]
        if not (ranges[k] > 0.0).any():
            continue
        inside = is_inside(coefficients, polyline, poses[k, 0], poses[k, 1])
        for i in range(len(sensors.rays)):
            if not ranges[k, i] > 0.0:
                continue
            if not inside:
                rays, beyond = rays + 1, beyond + 1
                continue
            h, _, _, _ = expected_range(wall, poses[k], sensors.rays[i], H, D)
            if math.isnan(h):
                continue
            rays += 1
            J[0], J[1] = H[0], H[1]
            J[2] = H[2] + H[1] * (poses[k, 0] - x[0]) - H[0] * (poses[k, 1] - x[1])
            along, across = H[0] * H[0] + H[1] * H[1], H[2] * H[2]
            s = (sensors.relative * h) ** 2 + sensors.absolute**2
            s += scale * (along * ways[k] * ways[k] + across * turns[k] * turns[k])
            nu = ranges[k, i] - h
            for a in range(3):
                PJ[a] = P[a, 0] * J[0] + P[a, 1] * J[1] + P[a, 2] * J[2]
                nu -= J[a] * d[a]
            s += J[0] * PJ[0] + J[1] * PJ[1] + J[2] * PJ[2]
            if nu * nu > sensors.gate * s:
                beyond += 1
                continue
            nis += nu * nu / s
            for a in range(3):
                d[a] += PJ[a] * nu / s
                for c in range(3):
                    P[a, c] -= PJ[a] * PJ[c] / s
    return Fit(rays, beyond, nis, d, P)


@njit(cache=True, nogil=True)
def refit(states: Array, way: Way, wall: WallShape, sensors: RaySensors, reckoning: Reckoning) -> tuple[Array, Array]:
    """Fit each of ``states`` (m, 4), in place, to the ranges on the way to it by Gauss-Newton steps within the wall.

    Returns the sums of NIS (m,), infinite where a ray is beyond the gate or the steps do not end, and the covariances
    (m, 3, 3) of the poses.
    """
    far, covariances = np.full(len(states), np.inf), np.zeros((len(states), 3, 3))
    ungated = RaySensors(sensors.rays, sensors.relative, sensors.absolute, np.inf, sensors.outliers, sensors.longest)
    for m in range(len(states)):
        x, ended = states[m], False
        for _ in range(_STEPS):
            d = replay(x, way, wall, ungated, reckoning).d
            largest = max(abs(d[0]), abs(d[1]), abs(d[2]))
            if not math.isfinite(largest):
                break
            share = min(1.0, _LONGEST / max(largest, 1e-300))
            share *= step_within(wall, x[0], x[1], share * d[0], share * d[1])
            for a in range(3):
                x[a] += share * d[a]
            x[2] = wrapped(x[2])
            if largest < _LAST:
                ended = True
                break
        if ended:
            fit = replay(x, way, wall, sensors, reckoning)
            if fit.rays > 0 and fit.beyond == 0:
                far[m], covariances[m] = fit.nis, fit.P
    return far, covariances


_ARGUMENTS = (
    named(Way, TWO, TWO, ONE), WALL, SENSORS, named(Reckoning, ONE, types.float64, types.float64),
)  # fmt: skip
KERNELS: tuple[Signature, ...] = ((replay, (ONE, *_ARGUMENTS)), (refit, (TWO, *_ARGUMENTS)))
