"""A bank of extended Kalman filters, compiled: K hypotheses of where a robot is, scored by what the rays tell.

    L <- forgetting L - (NIS + ln |S|) / 2,   L <- L - max L

is the logarithm of how likely a hypothesis is beside the best one, the past being forgotten. One whose score falls
below a limit is dropped (its score is NaN), and so is a twin of the best: one that, turned by a rotation that maps the
wall onto itself, is no farther from the best than its covariance allows, d' P^-1 d < twin.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.feasible_set_kernels import solved
from mathnavi.estimators.ranging.kalman_kernels import RaySensors, condition, predict
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.sim.interfaces.compiled import njit
from mathnavi.sim.interfaces.signals import Array

Hypotheses = tuple[Array, Array, Array, Array]
"""K of them: x (K, 4), P (K, 4, 4), score (K,), NaN where there is none, and misfit (K,), the mean of NIS per ray"""

Scoring = tuple[float, float, float, float]
"""what is left of a score (forgetting) and of a misfit (memory) after an update; the score at which a hypothesis is
dropped (lowest); d' P^-1 d below which two are the same (twin)"""

Symmetry = tuple[int, float, float]
"""number of the rotations that map the wall onto itself, the identity included; their centre (c_1, c_2) [m]"""


@njit(cache=True, nogil=True)
def predict_each(bank: Hypotheses, u: Array, W: Array, wall: WallShape, dt: float) -> None:
    """Predict every hypothesis that is alive, in place, over dt [s] under a reading u (2,) of variances W (2,); see
    ``predict``.
    """
    x, P, score, _ = bank
    for k in range(len(x)):
        if not math.isnan(score[k]):
            predict(x[k], P[k], u, W, wall, dt)


@njit(cache=True, nogil=True)
def condition_each(
    bank: Hypotheses, best: int, z: Array, wall: WallShape, sensors: RaySensors, scoring: Scoring
) -> tuple[int, float, int]:
    """Condition every hypothesis that is alive on ranges z (l,) [m], NaN where lost, in place; see ``condition``.

    Updates scores and misfits too. Returns the index of the best hypothesis, ``best`` among equals, its NIS, and the
    number of rays in it.
    """
    forgetting, memory, _, _ = scoring
    x, P, score, misfit = bank
    best_nis, best_rays = math.nan, 0
    nis_of, rays_of = np.empty(len(x)), np.zeros(len(x), np.int64)
    for k in range(len(x)):
        if math.isnan(score[k]):
            continue
        nis, log_det, rays, _ = condition(x[k], P[k], z, wall, sensors)
        score[k] = forgetting * score[k] - 0.5 * (nis + log_det)
        if rays > 0:
            misfit[k] = memory * misfit[k] + (1.0 - memory) * nis / rays
        nis_of[k], rays_of[k] = nis, rays
    for k in range(len(x)):
        if score[k] > score[best] or (math.isnan(score[best]) and not math.isnan(score[k])):
            best = k
    best_nis, best_rays = nis_of[best], rays_of[best]
    greatest = score[best]
    for k in range(len(x)):
        score[k] -= greatest
    return best, best_nis, best_rays


@njit(cache=True, nogil=True)
def drop(bank: Hypotheses, best: int, scoring: Scoring, symmetry: Symmetry) -> None:
    """Drop, in place, the hypotheses that are too unlikely, and the twins of the best one under the symmetry."""
    _, _, lowest, twin = scoring
    x, P, score, _ = bank
    rotations, c_1, c_2 = symmetry
    d = np.empty(3)
    for k in range(len(x)):
        if k == best or math.isnan(score[k]):
            continue
        if score[k] < lowest:
            score[k] = math.nan
            continue
        dx, dy = x[k, 0] - c_1, x[k, 1] - c_2
        for i in range(rotations):
            angle = 2.0 * math.pi * i / rotations
            c, s = math.cos(angle), math.sin(angle)
            d[0] = c_1 + c * dx - s * dy - x[best, 0]
            d[1] = c_2 + s * dx + c * dy - x[best, 1]
            d[2] = wrapped(x[k, 2] + angle - x[best, 2])
            w = solved(P[best], d)
            if d[0] * w[0] + d[1] * w[1] + d[2] * w[2] < twin:
                score[k] = math.nan
                break
