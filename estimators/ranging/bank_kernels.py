"""A bank of extended Kalman filters, compiled: K hypotheses of where a robot is, scored by what the rays tell.

    L <- forgetting L - (NIS + ln |S|) / 2,   L <- L - max L

is the logarithm of how likely a hypothesis is beside the best one, the past being forgotten. One whose score falls
below a limit is dropped (its score is NaN), and so is a twin of the best: one that, turned by a rotation that maps the
wall onto itself, is no farther from the best than its covariance allows, d' P^-1 d < twin.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from mathnavi.estimators.ranging.feasible_set_kernels import solved
from mathnavi.estimators.ranging.kalman_kernels import condition, predict
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.sim.interfaces.signals import Array


@njit(cache=True, nogil=True)
def predict_each(
    x: Array, P: Array, score: Array, u: Array, W: Array, coefficients: Array, polyline: Array, dt: float
) -> None:
    """Carry every hypothesis x (K, 4), P (K, 4, 4) that is alive on, in place; see ``predict``."""
    for k in range(len(x)):
        if not math.isnan(score[k]):
            predict(x[k], P[k], u, W, coefficients, polyline, dt)


@njit(cache=True, nogil=True)
def condition_each(
    x: Array,
    P: Array,
    score: Array,
    misfit: Array,
    best: int,
    z: Array,
    coefficients: Array,
    polyline: Array,
    angles: Array,
    relative: float,
    absolute: float,
    gate: float,
    forgetting: float,
    memory: float,
) -> tuple[int, float, int]:
    """Condition every hypothesis that is alive on ranges z (l,), in place; see ``condition``.

    Keeps the scores (K,) and the misfits (K,): the mean of NIS per ray, which fades by ``memory`` an update. Returns
    which hypothesis is the best, ``best`` among equals, its NIS, and how many rays that is of.
    """
    best_nis, best_rays = math.nan, 0
    nis_of, rays_of = np.empty(len(x)), np.zeros(len(x), np.int64)
    for k in range(len(x)):
        if math.isnan(score[k]):
            continue
        nis, log_det, told, _ = condition(x[k], P[k], z, coefficients, polyline, angles, relative, absolute, gate)
        score[k] = forgetting * score[k] - 0.5 * (nis + log_det)
        if told > 0:
            misfit[k] = memory * misfit[k] + (1.0 - memory) * nis / told
        nis_of[k], rays_of[k] = nis, told
    for k in range(len(x)):
        if score[k] > score[best] or (math.isnan(score[best]) and not math.isnan(score[k])):
            best = k
    best_nis, best_rays = nis_of[best], rays_of[best]
    greatest = score[best]
    for k in range(len(x)):
        score[k] -= greatest
    return best, best_nis, best_rays


@njit(cache=True, nogil=True)
def drop(
    x: Array, P: Array, score: Array, best: int, lowest: float, twin: float, rotations: int, c_1: float, c_2: float
) -> None:
    """Drop hypotheses, in place, that are too unlikely, and the best one's twins about the centre (c_1, c_2) [m]."""
    d = np.empty(3)
    for k in range(len(x)):
        if k == best or math.isnan(score[k]):
            continue
        if score[k] < lowest:
            score[k] = math.nan
            continue
        dx, dy = x[k, 0] - c_1, x[k, 1] - c_2
        for i in range(rotations):
            turn = 2.0 * math.pi * i / rotations
            c, s = math.cos(turn), math.sin(turn)
            d[0] = c_1 + c * dx - s * dy - x[best, 0]
            d[1] = c_2 + s * dx + c * dy - x[best, 1]
            d[2] = wrapped(x[k, 2] + turn - x[best, 2])
            w = solved(P[best], d)
            if d[0] * w[0] + d[1] * w[1] + d[2] * w[2] < twin:
                score[k] = math.nan
                break
