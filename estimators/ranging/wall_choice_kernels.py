"""Update of a Kalman filter by rays that may end on one of several walls of a polygon, compiled.

At a corner, at the edge of a door and past an obstacle the range of a ray jumps or bends within the errors of the pose:
linearised at the mean alone, a filter believes that the ray ends where the mean says, and is sure of it. So the walls
on which the ray may end are alternatives. A pose that is off by d moves the ray sideways, where it ends, by

    l = a' d,   a = (-sin beta, cos beta, h),   var l = a' P a,

and the edges of walls are taken as uncertain as the ranges, with a variance r of l besides. Rays from the five poses
that most likely have l = x_j sqrt(var l + r), at the nodes x_j and with the weights w_j of the Gauss-Hermite rule, give
the straight lines k on which it may end. Each is linearised at the mean, not where it was met:

    nu_k = z - h_k,   s_k = H_k P H_k' + r_k,   p_k = (1 - epsilon) w_k N(nu_k; 0, s_k),
    beta_k = p_k / (sum p_k + epsilon / L)

(probabilistic data association, Bar-Shalom and Tse, 1975, over walls in place of echoes), and with K_k = P H_k' / s_k
the pose is that of the mixture, of mean and covariance

    d = sum beta_k K_k nu_k,
    P <- P - sum beta_k K_k s_k K_k' + sum beta_k K_k nu_k^2 K_k' - d d'.

Rays are taken one after the other, all of them linearised at the same pose, first all that may end on
one line only, then the others. A second pass begins again with the same prediction, but
finds the walls around the pose that the first one came to, with its covariance (an iterated extended Kalman filter).

A ray is a **misfit** if it ends where the pose after the update does not have it, by more than three deviations: what
stands in the building and not on the map makes some of them, and an update that took the walls of another pose many.
Of n rays m are misfits with the binomial probability of m by the share epsilon of outliers in the first case, and of
half of them in the second, which one update in fifty is. By Bayes' rule m tells the probability pi that the walls were
those of another pose; then the prediction is what is known, so the estimate is the mixture of both:

    x <- (1 - pi) x + pi x-,    P <- (1 - pi) P + pi P- + pi (1 - pi) (x - x-)(x - x-)'.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import (
    GRAZING,
    Innovations,
    RaySensors,
    expected_range,
    square_trace,
    step_within,
)
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, cast_ray, curve_tangent, is_inside
from mathnavi.models.unicycle.kernels import mounted, wrapped

NODES = np.array([0.0, -1.355626179974266, 1.355626179974266, -2.856970013872806, 2.856970013872806])
"""x_j [standard deviations] of the Gauss-Hermite rule of five points"""
WEIGHTS = np.array([8.0 / 15.0, 0.2220759220056126, 0.2220759220056126, 0.01125741132772069, 0.01125741132772069])
"""w_j"""
PASSES = 2
"""passes of an update"""
_MISMATCHED = 0.02  # probability of an update that takes the walls of another pose
_OF_MISMATCHED = 0.5  # share of its rays that are misfits then
_FEWEST_MISFITS = 0.01  # share of misfits otherwise, at least
_REMEMBERED = 1.0 - 1.0 / 2000.0  # of a sum of products, per ray
_FITS = 3.0  # deviations that a range is off from a pose that explains it


@njit(cache=True, nogil=True)
def line_seen(
    coefficients: Array, k: int, q_1: float, q_2: float, beta: float, m_1: float, m_2: float, line: Array
) -> bool:
    """Write h [m], H (3,), B, E (``expected_range``) and k into ``line`` (7,): a ray from q = x + (m_1, m_2) at beta,
    as far as the straight line through wall k. False if it does not meet it, or grazes it.
    """
    e_x, e_y = math.cos(beta), math.sin(beta)
    t_x, t_y = curve_tangent(coefficients, k + 0.5)
    across, along = e_x * t_y - e_y * t_x, e_x * t_x + e_y * t_y
    if across * across < GRAZING**2 * (across * across + along * along):
        return False
    c_x, c_y = coefficients[1 + k, 0] - q_1, coefficients[1 + k, 1] - q_2
    length = (c_x * t_y - c_y * t_x) / across
    if not length > 0.0:
        return False
    line[0] = length
    line[1], line[2], line[3] = -t_y / across, t_x / across, length * along / across
    line[4] = -line[3] / length
    line[5] = length - line[1] * m_1 - line[2] * m_2
    line[3] += line[2] * m_1 - line[1] * m_2
    line[6] = k
    return True


@njit(cache=True, nogil=True)
def walls_met(
    wall: WallShape, x: Array, P: Array, ray: Array, relative: float, absolute: float, lines: Array, weights: Array
) -> int:
    """Write the lines on which a ``ray`` (3,) from x (4,), of covariance P (4, 4), may end.

    ``lines`` (5, 7) gets each of them as seen from x (``line_seen``), ``weights`` (5,) the probability of each. Returns
    their number, 0 where the ray has no information.
    """
    coefficients, polyline = wall
    beta, (m_1, m_2) = x[2] + ray[0], mounted(ray, x[2])
    q_1, q_2 = x[0] + m_1, x[1] + m_2
    e_x, e_y = math.cos(beta), math.sin(beta)
    h, s = cast_ray(coefficients, polyline, q_1, q_2, beta)
    if math.isnan(h):
        return 0
    a = np.array([-e_y, e_x, h + e_x * m_1 + e_y * m_2])
    Pa = np.empty(3)
    for j in range(3):
        Pa[j] = P[j, 0] * a[0] + P[j, 1] * a[1] + P[j, 2] * a[2]
    edge = (relative * h) ** 2 + absolute**2
    variance = a[0] * Pa[0] + a[1] * Pa[1] + a[2] * Pa[2] + edge
    deviation = math.sqrt(variance)
    met = np.empty(len(NODES), np.int64)
    count, total = 0, 0.0
    for n in range(len(NODES)):
        if n > 0:
            # What the edge is off by moves the ray like a step to the side.
            d = NODES[n] * deviation / variance
            _, s = cast_ray(
                coefficients, polyline, q_1 + d * (Pa[0] - m_2 * Pa[2] + edge * a[0]),
                q_2 + d * (Pa[1] + m_1 * Pa[2] + edge * a[1]),
                beta + d * Pa[2],
            )  # fmt: skip
            if math.isnan(s):
                continue
        k, known = int(s), False
        for j in range(count):
            if met[j] == k:
                weights[j] += WEIGHTS[n]
                known = True
        if known:
            total += WEIGHTS[n]
            continue
        if not line_seen(coefficients, k, q_1, q_2, beta, m_1, m_2, lines[count]):
            continue
        met[count], weights[count] = k, WEIGHTS[n]
        total += WEIGHTS[n]
        count += 1
    for j in range(count):
        weights[j] /= total
    return count


@njit(cache=True, nogil=True)
def condition_among_walls(
    x: Array, P: Array, z: Array, wall: WallShape, sensors: RaySensors, innovations: Innovations
) -> tuple[float, float, int]:
    """Condition x (4,) and P (4, 4), in place, on ranges z (l,) [m] within a polygon; see ``condition``.

    Innovations and NIS are those of the line on which a ray most likely ended, but for those that are ``tested``.
    """
    rays, relative, absolute, gate = sensors.rays, sensors.relative, sensors.absolute, sensors.gate
    likelihood, nis, read = 0.0, 0.0, 0
    lines, weights, taken = np.empty((len(NODES), 7)), np.empty(len(NODES)), np.empty(len(z), np.bool_)
    prior, before, at, Q, moved = P.copy(), x.copy(), x.copy(), P.copy(), np.zeros(4)
    innovations.tested[:] = math.nan
    for n in range(PASSES):
        likelihood, nis, read = 0.0, 0.0, 0
        innovations.outliers[0] = 0
        taken[:] = False
        P[:] = prior
        for j in range(4):
            moved[j] = before[j] - at[j]
        moved[2] = wrapped(moved[2])
        for i in range(len(z)):
            innovations.residual[i] = innovations.variance[i] = math.nan
            innovations.white[i] = innovations.share[i] = math.nan
        for is_last in range(2):
            for i in range(len(z)):
                if taken[i] or not z[i] > 0.0:
                    continue
                count = walls_met(wall, at, Q, rays[i], relative, absolute, lines, weights)
                if count == 0 or (count > 1 and not is_last):
                    continue
                taken[i] = True
                if n == 0:  # about the prediction itself
                    mean, variance = range_among(lines[:count], weights[:count], prior, relative, absolute)
                    innovations.tested[0, i], innovations.tested[1, i] = z[i] - mean, math.sqrt(variance)
                logarithm, nu, s, r, beta = _condition_on_one(
                    moved, P, z[i], Q, sensors, lines[:count], weights[:count]
                )
                read += 1
                nis += min(nu * nu / s, gate)
                likelihood += logarithm
                innovations.outliers[0] += beta < 0.5
                innovations.residual[i], innovations.variance[i] = nu, r
                innovations.white[i], innovations.share[i] = beta * nu / math.sqrt(s), r / s
        for j in range(4):
            x[j] = at[j] + moved[j]
        x[2] = wrapped(x[2])
        step = step_within(wall, before[0], before[1], x[0] - before[0], x[1] - before[1])
        if step < 1.0:
            for j in range(4):
                x[j] = before[j] + step * (wrapped(x[j] - before[j]) if j == 2 else x[j] - before[j])
            x[2] = wrapped(x[2])
        at[:], Q[:] = x, P
    innovations.misfits[0] = misfits(x, P, z, wall, sensors, innovations.fits[0])
    doubt(x, P, before, prior, mismatched(innovations.misfits[0], read, sensors.outliers), wall)
    return likelihood, nis, read


@njit(cache=True, nogil=True)
def range_among(lines: Array, weights: Array, P: Array, relative: float, absolute: float) -> tuple[float, float]:
    """Mean [m] and variance [m^2] of a range that ends on one of ``lines`` (m, 7), of ``weights`` (m,), as predicted.

    They are those of the mixture: sum w_k h_k, and sum w_k (s_k + h_k^2) less the square of the mean.
    """
    flat, mean, variance = np.zeros(3), 0.0, 0.0
    for k in range(len(lines)):
        mean += weights[k] * lines[k, 0]
    for k in range(len(lines)):
        h, H = lines[k, 0], lines[k, 1:4]
        s = (relative * h) ** 2 + absolute**2
        for j in range(3):
            s += H[j] * (P[j, 0] * H[0] + P[j, 1] * H[1] + P[j, 2] * H[2])
        s += 0.5 * square_trace(P[:3, :3], flat, lines[k, 5], lines[k, 4], 0.0, H)
        variance += weights[k] * (s + (h - mean) ** 2)
    return mean, variance


@njit(cache=True, nogil=True)
def mismatched(misfits: int, read: int, outliers: float) -> float:
    """Probability that an update took the walls of another pose, by its number of misfits among the rays ``read``."""
    if read == 0 or misfits == 0:
        return 0.0
    right = min(max(outliers, _FEWEST_MISFITS), 0.5)
    odds = _MISMATCHED / (1.0 - _MISMATCHED)
    odds *= (_OF_MISMATCHED / right) ** misfits * ((1.0 - _OF_MISMATCHED) / (1.0 - right)) ** (read - misfits)
    return odds / (1.0 + odds)


@njit(cache=True, nogil=True)
def doubt(x: Array, P: Array, before: Array, prior: Array, probability: float, wall: WallShape) -> None:
    """Mix x (4,) and P (4, 4), in place, with those ``before`` the update, of this ``probability``.

    Where the mean of two places within the wall is not within it, the place is the more probable one of them.
    """
    if probability == 0.0:
        return
    d = np.empty(4)
    for j in range(4):
        d[j] = before[j] - x[j]
    d[2] = wrapped(d[2])
    share = probability
    if not is_inside(wall[0], wall[1], x[0] + share * d[0], x[1] + share * d[1]):
        share = 1.0 if probability > 0.5 else 0.0
    mean = np.empty(4)
    for j in range(4):
        mean[j] = (share if j < 2 else probability) * d[j]
    for j in range(4):
        x[j] += mean[j]
        for i in range(4):
            off = (1.0 - probability) * mean[j] * mean[i] + probability * (d[j] - mean[j]) * (d[i] - mean[i])
            P[j, i] += probability * (prior[j, i] - P[j, i]) + off
    x[2] = wrapped(x[2])


@njit(cache=True, nogil=True)
def learn_correlation(innovations: Innovations) -> None:
    """Update the sums of products, in place, by the residuals of an update."""
    fits, products = innovations.fits, innovations.products
    for i in range(fits.shape[1]):
        now, before = fits[0, i], fits[1, i]
        if math.isnan(now):
            continue
        if not math.isnan(before):
            products[0] = _REMEMBERED * products[0] + now * before
            products[1] = _REMEMBERED * products[1] + 0.5 * (now * now + before * before)
        fits[1, i] = now


@njit(cache=True, nogil=True)
def misfits(x: Array, P: Array, z: Array, wall: WallShape, sensors: RaySensors, fits: Array) -> int:
    """Number of ranges z (l,) [m] that are more than three deviations off those from a pose x (4,), P (4, 4).

    Writes the residuals of the others over their deviations into ``fits`` (l,).
    """
    H, D, count = np.empty(3), np.empty(3), 0
    fits[:] = math.nan
    for i in range(len(z)):
        if not z[i] > 0.0:
            continue
        h, _, _, _ = expected_range(wall, x, sensors.rays[i], H, D)
        if math.isnan(h):
            continue
        noise = (sensors.relative * h) ** 2 + sensors.absolute**2
        variance = noise
        for j in range(3):
            variance += H[j] * (P[j, 0] * H[0] + P[j, 1] * H[1] + P[j, 2] * H[2])
        if (z[i] - h) ** 2 > _FITS**2 * variance:
            count += 1
        else:
            fits[i] = (z[i] - h) / math.sqrt(noise)
    return count


@njit(cache=True, nogil=True)
def _condition_on_one(
    moved: Array, P: Array, z: float, Q: Array, sensors: RaySensors, lines: Array, weights: Array
) -> tuple[float, float, float, float, float]:
    """Condition x (4,) and P (4, 4), in place, on a range z [m] of a ray that ends on one of the lines (m, 7).

    Returns the logarithm of the likelihood, nu [m], s and r [m^2] of the most likely line, and the probability that the
    range is no outlier.
    """
    count, best = len(lines), 0
    nu, s, r, share = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    K = np.empty((count, 4))
    flat = np.zeros(3)
    for k in range(count):
        h, H = lines[k, 0], lines[k, 1:4]
        for j in range(4):
            K[k, j] = P[j, 0] * H[0] + P[j, 1] * H[1] + P[j, 2] * H[2]
        r[k] = (sensors.relative * h) ** 2 + sensors.absolute**2
        s[k] = H[0] * K[k, 0] + H[1] * K[k, 1] + H[2] * K[k, 2] + r[k]
        s[k] += 0.5 * square_trace(Q[:3, :3], flat, lines[k, 5], lines[k, 4], 0.0, H)
        nu[k] = z - h - H[0] * moved[0] - H[1] * moved[1] - H[2] * moved[2]
        share[k] = math.log((1.0 - sensors.outliers) * weights[k]) - 0.5 * (
            nu[k] * nu[k] / s[k] + math.log(2.0 * math.pi * s[k])
        )
        if share[k] > share[best]:
            best = k
    # The likelihood of the range over that of the most likely line, or of an outlier.
    top, rest = share[best], 0.0
    if sensors.outliers > 0.0:
        uniform = math.log(sensors.outliers / sensors.longest)
        top = max(top, uniform)
        rest = math.exp(uniform - top)
    total, known = rest, 0.0
    for k in range(count):
        share[k] = math.exp(share[k] - top)
        known += share[k]
    total += known
    d, spread = np.zeros(4), np.zeros((4, 4))
    for k in range(count):
        share[k] /= total
        for j in range(4):
            K[k, j] /= s[k]
            d[j] += share[k] * K[k, j] * nu[k]
    for k in range(count):
        gain = share[k] * (nu[k] * nu[k] - s[k])
        for j in range(4):
            for i in range(4):
                spread[j, i] += gain * K[k, j] * K[k, i]
    for j in range(4):
        for i in range(4):
            P[j, i] += spread[j, i] - d[j] * d[i]
    for j in range(4):
        moved[j] += d[j]
    return top + math.log(total), nu[best], s[best], r[best], known / total
