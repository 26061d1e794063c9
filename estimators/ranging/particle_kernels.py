"""Augmented Monte Carlo localisation of a unicycle that reads ranges, compiled.

Thrun, Burgard and Fox, Probabilistic Robotics (2005), tables 8.2 to 8.4. Particles are states x (n, 4) as of
``kalman_kernels``, with weights w (n,) that sum to one.

    propagate   x_m <- f(x_m, (1 - b_m) u + noise of variances W),   b_m a Gauss-Markov process
    weigh       w_m <- w_m prod_i p_i(x_m)^beta,   p_i = (1 - epsilon) N(rho_i; h_i, r_i) + epsilon / L
    resample    where n_eff = 1 / sum w^2 < n / 2: as many as the occupied cells need (KLD sampling), systematically

beta is one, or less if n_eff would otherwise fall below a tenth of n in one update: with readings more accurate than
the particles are dense, only one would be left (adaptive likelihood: Pfaff, Burgard and Fox, 2006). Resampled particles
are regularised (Musso, Oudjane and Le Gland, 2001): with the mean m and the covariance C = A A' of their cluster

    x <- m + sqrt(1 - s^2) (x - m) + s A eta,   eta ~ N(0, 1),   s = (4 / (d + 2) / n)^(1 / (d + 4)),   d = 4,

with a smaller s where C is larger than a cell. This preserves mean and covariance.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import RaySensors, step_within
from mathnavi.estimators.ranging.particle_clusters import Cells, Clusters, difference, kld_bound, occupied_cells
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape, cast_ray, is_inside
from mathnavi.models.unicycle.kernels import integrate, mounted, wrapped

_SCALE_TIME = 3.0  # [s] correlation time of b: if all particles had the same b, none could find another
_LEAST_EFFECTIVE = 0.1  # n_eff over n after one update
_HALVINGS = 20  # of beta
_GROWTH = 1.25  # of the number of particles while the bound is searched
_FEW = 8  # particles of a cluster, too few for a covariance
_DIMENSION = 4
_TRIALS = 1000  # of a point within the wall


@njit(cache=True, nogil=True)
def propagate(
    x: Array, u: Array, deviation: Array, scale: float, wall: WallShape, dt: float, rng: np.random.Generator
) -> None:
    """Propagate particles x (n, 4), in place, over dt [s] under a reading u (2,) of standard deviations (2,).

    ``scale`` is the standard deviation of b.
    """
    memory = math.exp(-dt / _SCALE_TIME)
    renewed = scale * math.sqrt(1.0 - memory**2)
    for n in range(len(x)):
        u_1 = (1.0 - x[n, 3]) * u[0] + deviation[0] * rng.standard_normal()
        u_2 = (1.0 - x[n, 3]) * u[1] + deviation[1] * rng.standard_normal()
        _place(x[n], integrate(x[n, :3], u_1, u_2, dt), wall)
        x[n, 3] = memory * x[n, 3] + renewed * rng.standard_normal()


@njit(cache=True, nogil=True)
def weigh(x: Array, w: Array, z: Array, wall: WallShape, sensors: RaySensors, tested: Array) -> tuple[float, float]:
    """Weigh particles x (n, 4), w (n,), in place, by ranges z (l,) [m], NaN where lost.

    Writes the innovations, z less the mean range of the particles before, and their standard deviations, from the
    particles' spread and the mean noise, into ``tested`` (2, l) [m]; NaN where z is, or no particle sees a wall.
    Returns n_eff and the mean likelihood of the particles per range: the geometric mean over the ranges that were read,
    so that lost ones make no difference; NaN if none was read. It is relative to the density of a range that is read
    as the particles expect it: far off from a wall, where noise is larger, all densities are lower.
    """
    rays, relative, absolute, _, outliers, longest = sensors
    coefficients, polyline = wall
    log, read, peaks = np.zeros(len(x)), 0, 0.0
    for i in range(len(z)):
        tested[0, i] = tested[1, i] = math.nan
        if math.isnan(z[i]):
            continue
        read += 1
        total, off, spread, noise = 0.0, 0.0, 0.0, 0.0  # weight of the particles that see a wall, and sums over them
        for n in range(len(x)):
            m_1, m_2 = mounted(rays[i], x[n, 2])
            h, _ = cast_ray(coefficients, polyline, x[n, 0] + m_1, x[n, 1] + m_2, x[n, 2] + rays[i, 0])
            p = outliers / longest
            if not math.isnan(h):
                r = (relative * h) ** 2 + absolute**2
                p += (1.0 - outliers) * math.exp(-0.5 * (z[i] - h) ** 2 / r) / math.sqrt(2.0 * math.pi * r)
                total += w[n]
                off += w[n] * (z[i] - h)
                spread += w[n] * (z[i] - h) ** 2
                noise += w[n] * r
            log[n] += math.log(p)
        peak = outliers / longest
        if total > 0.0:
            nu = off / total
            tested[0, i], tested[1, i] = nu, math.sqrt(max(spread / total - nu * nu, 0.0) + noise / total)
            peak += (1.0 - outliers) / math.sqrt(2.0 * math.pi * noise / total)
        peaks += math.log(peak)
    greatest, beta = log.max(), 1.0
    after = w * np.exp(log - greatest)
    likelihood = math.exp((greatest + math.log(after.sum()) - peaks) / read) if read else math.nan
    for _ in range(_HALVINGS):
        if after.sum() ** 2 >= _LEAST_EFFECTIVE * len(x) * np.square(after).sum():
            break
        beta *= 0.5
        after = w * np.exp(beta * (log - greatest))
    w[:] = after / after.sum()
    return 1.0 / np.square(w).sum(), likelihood


@njit(cache=True, nogil=True)
def resampled(w: Array, start: float, count: int) -> Integers:
    """Indices (count,) of the particles at the places (n + start) / count of the cumulated weights, start in [0, 1)."""
    chosen = np.empty(count, np.int64)
    k, cumulated = 0, w[0]
    for n in range(count):
        while (n + start) / count >= cumulated and k < len(w) - 1:
            k += 1
            cumulated += w[k]
        chosen[n] = k
    return chosen


@njit(cache=True, nogil=True)
def resample(
    x: Array,
    w: Array,
    clusters: Clusters,
    random: float,
    limits: tuple[int, int],
    kld: tuple[float, float],
    cells: Cells,
    scale: float,
    wall: WallShape,
    rng: np.random.Generator,
) -> Array:
    """Resample particles x (n, 4) of weights w (n,) and of ``clusters``; returns particles (m, 4) of equal weight.

    A share ``random`` is drawn uniformly within the wall, b with the standard deviation ``scale``. m is the least
    number that satisfies the bound for ``kld``, epsilon and z, within ``limits``, least and most.
    """
    cell, _ = occupied_cells(x, cells)
    start, count = rng.random(), limits[0]
    while True:
        new = round(random * count)
        chosen = resampled(w, start, count - new)
        needed = kld_bound(new + _distinct(cell, chosen), kld[0], kld[1])
        if needed <= count or count >= limits[1]:
            break
        count = min(limits[1], max(math.ceil(needed), math.ceil(_GROWTH * count)))
    after = np.empty((count, 4))
    after[: len(chosen)] = x[chosen]
    _regularise(after[: len(chosen)], clusters, clusters.label[chosen], x, cells, wall, rng)
    low, high = np.empty(2), np.empty(2)
    for j in range(2):
        low[j], high[j] = wall[1][:, j].min(), wall[1][:, j].max()
    for n in range(len(chosen), count):
        _draw(after[n], low, high, scale, wall, rng)
    return after


@inner_njit(nogil=True)
def _regularise(
    after: Array,
    clusters: Clusters,
    label: Integers,
    x: Array,
    cells: Cells,
    wall: WallShape,
    rng: np.random.Generator,
) -> None:
    """Regularise particles ``after`` (m, 4), in place, each by its cluster (m,); x (n, 4) are those before."""
    K = len(clusters.weight)
    side = np.array([cells.position, cells.position, 2.0 * math.pi / cells.headings])
    factor, share = np.zeros((K, 4, 4)), np.zeros(K)
    for c in range(K):
        C, s = clusters.covariance[c], (4.0 / (_DIMENSION + 2) / clusters.members[c]) ** (1.0 / (_DIMENSION + 4))
        if clusters.members[c] < _FEW:
            for j in range(3):
                factor[c, j, j] = 0.5 * side[j]
            continue
        for j in range(3):
            s = min(s, side[j] / math.sqrt(max(C[j, j], 1e-300)))
        share[c] = s
        factor[c] = s * _cholesky(C)
    d, eta = np.empty(4), np.empty(4)
    for n in range(len(after)):
        c = label[n]
        keep = math.sqrt(1.0 - share[c] ** 2)
        difference(after[n], x[clusters.origin[c]], d)
        for j in range(4):
            eta[j] = rng.standard_normal()
        for j in range(4):
            d[j] = (keep - 1.0) * (d[j] - clusters.offset[c, j])
            for k in range(j + 1):
                d[j] += factor[c, j, k] * eta[k]
        _place(after[n], after[n, :3] + d[:3], wall)
        after[n, 3] += d[3]


@inner_njit(nogil=True)
def _cholesky(C: Array) -> Array:
    """Lower factor (4, 4) of a covariance that may be singular."""
    A = np.zeros((4, 4))
    for j in range(4):
        for i in range(j, 4):
            value = C[i, j]
            for k in range(j):
                value -= A[i, k] * A[j, k]
            if i == j:
                A[j, j] = math.sqrt(max(value, 0.0))
            elif A[j, j] > 0.0:
                A[i, j] = value / A[j, j]
    return A


@inner_njit(nogil=True)
def _distinct(cell: Integers, chosen: Integers) -> int:
    """Number of different values of ``cell`` (n,) among those ``chosen`` (m,)."""
    seen = np.zeros(cell.max() + 1, np.bool_)
    for n in chosen:
        seen[cell[n]] = True
    return int(seen.sum())


@njit(cache=True, nogil=True)
def _draw(x: Array, low: Array, high: Array, scale: float, wall: WallShape, rng: np.random.Generator) -> None:
    """Draw a new state (4,), in place, at a point within the wall, or at the wall's first vertex if no trial is."""
    coefficients, polyline = wall
    x[:2] = polyline[0]
    for _ in range(_TRIALS):
        p_1, p_2 = low[0] + (high[0] - low[0]) * rng.random(), low[1] + (high[1] - low[1]) * rng.random()
        if is_inside(coefficients, polyline, p_1, p_2):
            x[0], x[1] = p_1, p_2
            break
    x[2], x[3] = math.pi * (2.0 * rng.random() - 1.0), scale * rng.standard_normal()


@njit(cache=True, nogil=True)
def _place(x: Array, pose: Array, wall: WallShape) -> None:
    """Give a particle (4,) a pose (3,), in place, or move it there as far as the wall permits."""
    d_1, d_2 = pose[0] - x[0], pose[1] - x[1]
    step = step_within(wall, x[0], x[1], d_1, d_2)
    x[0] += step * d_1
    x[1] += step * d_2
    x[2] = wrapped(pose[2])
