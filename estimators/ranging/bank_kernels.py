"""A bank of extended Kalman filters, compiled: K hypotheses of where a robot is, scored by their ranges.

    L <- forgetting L + ln p(rho),   L <- L - max L

is the logarithm of a hypothesis' likelihood relative to the best one, with exponential forgetting. A hypothesis whose
score falls below a limit is dropped (its score is NaN), and so is a twin of the best: one that, after a rotation that
maps the wall onto itself, is no farther from the best than its covariance allows, d' P^-1 d < twin.

**Noise.** Ranges have the noise and the outliers that the residuals of the best hypothesis show (``noise_kernels``).

**Slip.** Wheels that slip, or whose radius is not the declared one, move the robot in a way that odometry does not
measure. The predictions of a hypothesis are then worse than its covariance says, and its innovations are no longer
white: nu_k correlates with those before it (Mehra, 1970). With the exponentially weighted mean m_i of white innovations
n_i, of variance v, and the noise's share a_i of each innovation's variance,

    ln q <- ln q + eta (mean_i (a_i n_i m_i / sqrt v) - delta),
    m_i <- mu m_i + (1 - mu) n_i,   v = (1 - mu) / (1 + mu),

converges where they are nearly white again (Robbins and Monro, 1951); delta keeps q low where they are white. The
process noise that a hypothesis adds to its pose and to the scale of its odometry has the intensity q - q_0 [m^2/s], or
zero if that is negative,

    P <- P + max(q - q_0, 0) dt diag(w_1, w_1, w_2 c_phi^2, c_b^2),   q between a least and a most value,

and weights w of mean one that are greater while the wheels change their speed (``feasible_set_bank``).

**An odometry whose scale is not as declared.** A hypothesis that does not know its scale error b fits nearly any pose,
so that its filter takes b as declared. What it would know with a prior of deviation sigma_0, mean m and variance M of
b, follows from its own x_4 and P_44 before (-) and after (+) an update (Friedland, 1969), for what readings say of b
does not depend on the prior:

    1 / M <- 1 / M + (1 / P_44+ - 1 / P_44-),   m / M <- m / M + (x_4+ / P_44+ - x_4- / P_44-),

and a pose is off by V b, V = P_14 / P_44 (3,), per scale error that the filter does not know of. Second moments of its
error are P + V V' (M - P_44 + (m - x_4)^2): a margin that the readings narrow. What slip adds to P_44 is of a scale
that has been so all the time: P_14 grows with it, so that V stays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from mathnavi.estimators.ranging.feasible_set_kernels import farthest_points, project, pushed, solved
from mathnavi.estimators.ranging.kalman_kernels import (
    Innovations,
    RaySensors,
    condition,
    expected_ranges,
    move,
    predict,
    within,
)
from mathnavi.estimators.ranging.noise_kernels import NoiseSums, learn_noise, noise_of, remember
from mathnavi.estimators.ranging.reading_kernels import is_within, select_ranges
from mathnavi.estimators.ranging.wall_choice_kernels import condition_among_walls, learn_correlation
from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, TWO_READ, array, combined, named
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.field.polygon_kernels import is_polygonal
from mathnavi.models.unicycle.kernels import wrapped

LEAST_SLIP, MOST_SLIP = 2e-7, 0.03
"""[m^2/s] bounds of q"""

BY_HEADING = 8.0
"""[rad/m] c_phi"""

_BY_SCALE = 1.0  # [1/m] c_b
GRIP = 2e-6  # [m^2/s] q_0
_ADAPTATION = 0.15  # eta
_LEAK = 0.02  # delta
_AVERAGING = 0.97  # mu
_UNDECLARED, _DECLARED = 0.02, 1e-4  # least deviations of b: sigma_0, as wheels are made; and of a filter, not zero
_AVERAGED = math.sqrt((1.0 - _AVERAGING) / (1.0 + _AVERAGING))  # sqrt v
_NEAR = 0.1  # [m, rad] least deviation of a pose that was fitted, for what is not linear
_LARGEST = 4.0  # magnitude of a product n m / sqrt v, beyond which it is cut


Flags = NDArray[np.bool_]


class Hypotheses(NamedTuple):
    """K hypotheses, changed in place."""

    x: Array  # (K, 4)
    P: Array  # (K, 4, 4)
    score: Array  # (K,) L, NaN for a hypothesis that was dropped
    misfit: Array  # (K,) the mean of NIS per ray
    slip: Array  # (K,) [m^2/s] q
    mean: Array  # (K, l) m
    recent: Array  # (K, l, WINDOW) last residuals of each ray over their declared deviation
    readings: Integers  # (K, l) number of readings of each ray
    scale: Array  # (K, 2) m, M


class Scoring(NamedTuple):
    """Parameters by which hypotheses are scored."""

    forgetting: float  # what is left of a score after an update
    memory: float  # what is left of a misfit after one
    lowest: float  # score at which a hypothesis is dropped
    twin: float  # d' P^-1 d below which two are the same


Symmetry = tuple[int, float, float]
"""number of the rotations that map the wall onto itself, the identity included; their centre (c_1, c_2) [m]"""


def no_hypotheses(count: int, rays: int, window: int) -> Hypotheses:
    """Empty arrays for ``count`` hypotheses of a robot with ``rays`` range sensors, with ``window`` residuals for each
    ray.
    """
    return Hypotheses(
        np.zeros((count, 4)),
        np.zeros((count, 4, 4)),
        np.full(count, np.nan),
        np.ones(count),
        np.full(count, LEAST_SLIP),
        np.zeros((count, rays)),
        np.zeros((count, rays, window)),
        np.zeros((count, rays), np.int64),
        np.tile([0.0, _UNDECLARED**2], (count, 1)),
    )


def declare_scale(bank: Hypotheses, count: int, deviation: float) -> None:
    """Begin with a scale error of the declared ``deviation`` in the first ``count`` hypotheses, in place."""
    bank.P[:count, 3, 3] = max(deviation, _DECLARED) ** 2
    bank.scale[:count] = 0.0, max(deviation, _UNDECLARED) ** 2


@njit(cache=True, nogil=True)
def predict_each(bank: Hypotheses, u: Array, W: Array, wall: WallShape, dt: float, weights: Array) -> None:
    """Predict every hypothesis that was not dropped, in place, over dt [s] under a reading u (2,) of variances W (2,);
    see ``predict``. The process noise of slip in position and heading has the ``weights`` w (2,).
    """
    for k in range(len(bank.score)):
        if math.isnan(bank.score[k]):
            continue
        P, q = bank.P[k], max(bank.slip[k] - GRIP, 0.0) * dt
        predict(bank.x[k], P, u, W, wall, dt)
        P[0, 0] += q * weights[0]
        P[1, 1] += q * weights[0]
        P[2, 2] += q * weights[1] * BY_HEADING**2
        _release_scale(P, q * _BY_SCALE**2)
        bank.scale[k, 1] += q * _BY_SCALE**2


@njit(cache=True, nogil=True)
def condition_each(
    bank: Hypotheses,
    best: int,
    z: Array,
    wall: WallShape,
    sensors: RaySensors,
    noise: NoiseSums,
    scoring: Scoring,
    innovations: Innovations,
) -> tuple[int, float, int]:
    """Condition every hypothesis that was not dropped on ranges z (l,) [m], NaN where lost, in place; see
    ``condition``.

    ``sensors`` have the declared noise, ``noise`` the estimate of the true one, updated by the best hypothesis, whose
    outliers are counted and whose innovations are kept. Updates scores, misfits and slips too. Returns the index of
    the best hypothesis (``best`` if several are equal), its NIS, and the number of rays in the NIS.
    """
    score, misfit = bank.score, bank.misfit
    sigma, epsilon = noise_of(noise)
    polygonal = is_polygonal(wall[0])
    if polygonal:
        sigma = max(sigma, 1.0)  # what the map is wrong by changes slowly, and does not show in the noise
    true = RaySensors(
        sensors.rays, sigma * sensors.relative, sigma * sensors.absolute, sensors.gate, epsilon, sensors.longest
    )
    nis_of, rays_of = np.zeros(len(score)), np.zeros(len(score), np.int64)
    for k in range(len(score)):
        if math.isnan(score[k]):
            continue
        b, P_44 = bank.x[k, 3], bank.P[k, 3, 3]
        if polygonal:
            likelihood, nis, rays = condition_among_walls(bank.x[k], bank.P[k], z, wall, true, innovations)
        else:
            likelihood, nis, rays = condition(bank.x[k], bank.P[k], z, wall, true, innovations)
        _learn_scale(bank.scale[k], b, P_44, bank.x[k, 3], bank.P[k, 3, 3])
        score[k] = scoring.forgetting * score[k] + likelihood
        if rays > 0:
            misfit[k] = scoring.memory * misfit[k] + (1.0 - scoring.memory) * nis / rays
        nis_of[k], rays_of[k] = nis, rays
        for i in range(len(z)):
            innovations.variance[i] /= sigma * sigma
        remember(bank.recent[k], bank.readings[k], innovations.residual, innovations.variance)
        if k == best:
            innovations.outliers[1] += innovations.outliers[0]
            innovations.misfits[1] += innovations.misfits[0]
            innovations.of_best[:] = innovations.tested
            if polygonal:
                learn_correlation(innovations)
            learn_noise(
                noise, bank.recent[k], bank.readings[k], innovations.residual, innovations.variance, sensors.longest
            )
        bank.slip[k] = _slip(bank.slip[k], bank.mean[k], innovations)
    for k in range(len(score)):
        if score[k] > score[best] or (math.isnan(score[best]) and not math.isnan(score[k])):
            best = k
    greatest = score[best]
    for k in range(len(score)):
        score[k] -= greatest
    return best, nis_of[best], rays_of[best]


@njit(cache=True, nogil=True)
def _slip(q: float, mean: Array, innovations: Innovations) -> float:
    """q [m^2/s] after one update; the means m (l,) are changed in place."""
    product, rays = 0.0, 0
    for i in range(len(mean)):
        white = innovations.white[i]
        if math.isnan(white):
            continue
        rays += 1
        product += innovations.share[i] * min(max(white * mean[i] / _AVERAGED, -_LARGEST), _LARGEST)
        mean[i] = _AVERAGING * mean[i] + (1.0 - _AVERAGING) * white
    if rays == 0:
        return q
    return min(max(q * math.exp(_ADAPTATION * (product / rays - _LEAK)), LEAST_SLIP), MOST_SLIP)


@njit(cache=True, nogil=True)
def _release_scale(P: Array, variance: float) -> None:
    """Add a ``variance`` to that of b in P (4, 4), in place: of a scale that has been so all the time."""
    if variance == 0.0:
        return
    share = 1.0 + variance / P[3, 3]
    for i in range(3):
        for j in range(3):
            P[i, j] += (share - 1.0) * P[i, 3] * P[j, 3] / P[3, 3]
    for i in range(3):
        P[i, 3] *= share
        P[3, i] *= share
    P[3, 3] *= share


@njit(cache=True, nogil=True)
def _learn_scale(scale: Array, b: float, P: float, b_after: float, P_after: float) -> None:
    """Update m and M (2,) in place by an update from b, of variance P, to those ``after`` it."""
    m, M = scale[0], scale[1]
    scale[1] = 1.0 / (1.0 / M + max(1.0 / P_after - 1.0 / P, 0.0))
    scale[0] = scale[1] * (m / M + b_after / P_after - b / P)


@njit(cache=True, nogil=True)
def covariance_of(bank: Hypotheses, k: int) -> Array:
    """Second moments (3, 3) of the error of hypothesis k, with what its scale may be off by."""
    b, P, (m, M) = bank.x[k, 3], bank.P[k], bank.scale[k]
    more = max(M - P[3, 3] + (m - b) ** 2, 0.0) / P[3, 3] ** 2
    moments = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            moments[i, j] = 0.5 * (P[i, j] + P[j, i]) + more * P[i, 3] * P[j, 3]
    return moments


@njit(cache=True, nogil=True)
def drop(bank: Hypotheses, best: int, scoring: Scoring, symmetry: Symmetry) -> None:
    """Drop, in place, the hypotheses that are too unlikely, and the twins of the best one under the symmetry."""
    score = bank.score
    for k in range(len(score)):
        if k == best or math.isnan(score[k]):
            continue
        if score[k] < scoring.lowest or square_apart(bank.x[k], bank.x[best], bank.P[best], symmetry) < scoring.twin:
            score[k] = math.nan


@njit(cache=True, nogil=True)
def add(bank: Hypotheses, best: int, states: Array, covariances: Array, symmetry: Symmetry) -> None:
    """Add ``states`` (m, 4) whose poses have ``covariances`` (m, 3, 3), in place, as hypotheses that are as likely as
    the best, where there is room and none is within their errors.
    """
    for m in range(len(states)):
        free, P = -1, covariances[m] + _NEAR**2 * np.eye(3)
        for k in range(len(bank.score)):
            if math.isnan(bank.score[k]):
                free = k
            elif square_apart(states[m], bank.x[k], P, symmetry) < 1.0:
                free = -1
                break
        if free >= 0:
            bank.x[free], bank.P[free] = states[m], 0.0
            bank.P[free, :3, :3], bank.P[free, 3, 3] = P, bank.P[best, 3, 3]
            bank.scale[free] = bank.scale[best]  # the wheels are the same
            bank.mean[free], bank.readings[free] = 0.0, 0
            bank.misfit[free], bank.slip[free] = 1.0, 0.0
            bank.score[free] = bank.score[best]


@njit(cache=True, nogil=True)
def apart(bank: Hypotheses, best: int, symmetry: Symmetry, limit: float) -> Flags:
    """True (K,) for the hypotheses that are farther from the best, under the symmetry, than d' P^-1 d = ``limit``."""
    flags = np.zeros(len(bank.score), np.bool_)
    for k in range(len(flags)):
        if k != best and not math.isnan(bank.score[k]):
            flags[k] = square_apart(bank.x[k], bank.x[best], bank.P[best], symmetry) >= limit
    return flags


@njit(cache=True, nogil=True)
def square_apart(x: Array, best: Array, P: Array, symmetry: Symmetry) -> float:
    """The least d' P^-1 d of a state x (4,) from the ``best``, of covariance P (4, 4), over all rotations of it."""
    rotations, c_1, c_2 = symmetry
    d, least = np.empty(3), math.inf
    dx, dy = x[0] - c_1, x[1] - c_2
    for i in range(rotations):
        angle = 2.0 * math.pi * i / rotations
        c, s = math.cos(angle), math.sin(angle)
        d[0] = c_1 + c * dx - s * dy - best[0]
        d[1] = c_2 + s * dx + c * dy - best[1]
        d[2] = wrapped(x[2] + angle - best[2])
        w = solved(P, d)
        least = min(least, d[0] * w[0] + d[1] * w[1] + d[2] * w[2])
    return least


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
WALL = combined(TWO_READ, TWO_READ)
HYPOTHESES = named(Hypotheses, TWO, THREE, ONE, ONE, ONE, TWO, THREE, array(2, types.int64), TWO)
SENSORS = named(RaySensors, TWO, types.float64, types.float64, types.float64, types.float64, types.float64)
SUMS = named(NoiseSums, ONE, ONE)
SYMMETRY = combined(types.int64, types.float64, types.float64)
SCORING = named(Scoring, types.float64, types.float64, types.float64, types.float64)
INNOVATIONS = named(Innovations, ONE, ONE, ONE, ONE, array(1, types.int64), array(1, types.int64), TWO, ONE, TWO, TWO)
KERNELS: tuple[Signature, ...] = (
    (condition_each, (HYPOTHESES, types.int64, ONE, WALL, SENSORS, SUMS, SCORING, INNOVATIONS)),
    (project, (TWO, ONE, ONE, WALL, TWO, types.int64, types.float64)),
    (expected_ranges, (WALL, ONE, TWO)),
    (predict_each, (HYPOTHESES, ONE, ONE, WALL, types.float64, ONE)),
    (move, (ONE, ONE, WALL, types.float64)),
    (covariance_of, (HYPOTHESES, types.int64)),
    (drop, (HYPOTHESES, types.int64, SCORING, SYMMETRY)),
    (add, (HYPOTHESES, types.int64, TWO, THREE, SYMMETRY)),
    (square_apart, (ONE, ONE, TWO, SYMMETRY)),
    (apart, (HYPOTHESES, types.int64, SYMMETRY, types.float64)),
    (noise_of, (SUMS,)),
    (select_ranges, (ONE, types.float64, ONE)),
    (is_within, (ONE, ONE)),
    (pushed, (TWO, TWO, WALL, types.float64, types.float64)),
    (within, (WALL, TWO)),
    (farthest_points, (TWO, types.int64, types.int64, types.float64)),
)
