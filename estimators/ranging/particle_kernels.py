"""A particle filter of a unicycle that reads ranges, compiled: sampling importance resampling.

Particles are states x (N, 4) as of ``kalman_kernels``, with weights w (N,) that sum to one.

    propagate   x_n <- f(x_n, (1 - b_n) u + noise of variances W)
    weigh       w_n <- w_n prod_i N(rho_i; h_i(x_n), r_i(x_n)),   N_eff = 1 / sum w_n^2
    resample    N particles at the N equidistant places of the cumulated weights (systematic)
    roughen     x_n <- x_n + noise of deviation kappa E N^(-1/4),   E the extent of the particles in each coordinate

Roughening (Gordon, Salmond and Smith, 1993) keeps particles that were one and the same apart; b, which does not change,
has no other way to be found. It makes the filter's error wider than the readings would.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import RaySensors, step_within
from mathnavi.models.field.kernels import WallShape, cast_ray
from mathnavi.models.unicycle.kernels import integrate, wrapped
from mathnavi.sim.interfaces.compiled import njit
from mathnavi.sim.interfaces.signals import Array, Integers


@njit(cache=True, nogil=True)
def propagate(x: Array, u: Array, deviation: Array, wall: WallShape, dt: float, rng: np.random.Generator) -> None:
    """Propagate particles x (N, 4), in place, over dt [s] under a reading u (2,) of standard deviations (2,)."""
    for n in range(len(x)):
        u_1 = (1.0 - x[n, 3]) * u[0] + deviation[0] * rng.standard_normal()
        u_2 = (1.0 - x[n, 3]) * u[1] + deviation[1] * rng.standard_normal()
        _place(x[n], integrate(x[n, :3], u_1, u_2, dt), wall)


@njit(cache=True, nogil=True)
def weigh(
    x: Array,
    w: Array,
    z: Array,
    wall: WallShape,
    sensors: RaySensors,
) -> float:
    """Weigh particles x (N, 4), w (N,), in place, by ranges z (l,) [m], NaN where lost.

    Returns N_eff. A range is never less likely than one at the gate, so that one that is wholly wrong does not decide.
    """
    angles, relative, absolute, gate, _, _ = sensors
    coefficients, polyline = wall
    log = np.empty(len(x))
    for n in range(len(x)):
        log[n] = 0.0
        for i in range(len(z)):
            if math.isnan(z[i]):
                continue
            h, _ = cast_ray(coefficients, polyline, x[n, 0], x[n, 1], x[n, 2] + angles[i])
            if math.isnan(h):
                log[n] -= 0.5 * gate
                continue
            r = (relative * h) ** 2 + absolute**2
            log[n] -= 0.5 * (min((z[i] - h) ** 2 / r, gate) + math.log(r))
    greatest, total, squares = log.max(), 0.0, 0.0
    for n in range(len(x)):
        w[n] *= math.exp(log[n] - greatest)
        total += w[n]
    for n in range(len(x)):
        w[n] = w[n] / total if total > 0.0 else 1.0 / len(x)
        squares += w[n] * w[n]
    return 1.0 / squares


@njit(cache=True, nogil=True)
def resampled(w: Array, start: float) -> Integers:
    """Indices (N,) of the particles at the places (n + start) / N of the cumulated weights, start in [0, 1)."""
    chosen = np.empty(len(w), np.int64)
    k, cumulated = 0, w[0]
    for n in range(len(w)):
        while (n + start) / len(w) >= cumulated and k < len(w) - 1:
            k += 1
            cumulated += w[k]
        chosen[n] = k
    return chosen


@njit(cache=True, nogil=True)
def roughen(x: Array, kappa: float, wall: WallShape, rng: np.random.Generator) -> None:
    """Add the noise of roughening to particles x (N, 4), in place."""
    scale = kappa * len(x) ** -0.25
    extent = np.empty(4)
    for j in range(4):
        extent[j] = x[:, j].max() - x[:, j].min()
    for n in range(len(x)):
        after = x[n, :3].copy()
        for j in range(3):
            after[j] += scale * extent[j] * rng.standard_normal()
        _place(x[n], after, wall)
        x[n, 3] += scale * extent[3] * rng.standard_normal()


@njit(cache=True, nogil=True)
def mode(x: Array, w: Array, before: Array, radius: float, starts: int, wall: WallShape) -> tuple[Array, Array]:
    """Mean (4,) and covariance (3, 3) of the particles within ``radius`` [m, rad] of a place where there are most.

    Of ``starts`` particles, at equidistant places of the cumulated weights, and the state ``before`` (4,), the one with
    the most weight around it. What was the mode before stays it until another one has twice its weight. A mean that
    is outside of a wall that is not convex is drawn back towards that place.
    """
    chosen = resampled(w, 0.5)
    centre, most = before.copy(), 2.0 * _around(x, w, before, radius)
    for k in range(starts):
        here = x[chosen[(2 * k + 1) * len(x) // (2 * starts)]]
        weight = _around(x, w, here, radius)
        if weight > most:
            centre, most = here.copy(), weight
    mean, P, total = np.zeros(4), np.zeros((3, 3)), 0.0
    deviation = np.empty(4)
    for n in range(len(x)):
        if _near(x[n], centre, radius):
            total += w[n]
            for j in range(4):
                mean[j] += w[n] * (wrapped(x[n, j] - centre[j]) if j == 2 else x[n, j] - centre[j])
    if total == 0.0:
        return before.copy(), np.diag(np.array([radius, radius, radius]) ** 2)
    mean /= total
    for n in range(len(x)):
        if _near(x[n], centre, radius):
            for j in range(3):
                deviation[j] = (wrapped(x[n, j] - centre[j]) if j == 2 else x[n, j] - centre[j]) - mean[j]
            for j in range(3):
                for k in range(3):
                    P[j, k] += w[n] / total * deviation[j] * deviation[k]
    step = step_within(wall, centre[0], centre[1], mean[0], mean[1])
    mean[:2] *= step
    mean += centre
    mean[2] = wrapped(mean[2])
    return mean, P


@njit(cache=True, nogil=True)
def _around(x: Array, w: Array, centre: Array, radius: float) -> float:
    total = 0.0
    for n in range(len(x)):
        if _near(x[n], centre, radius):
            total += w[n]
    return total


@njit(cache=True, nogil=True)
def _near(a: Array, b: Array, radius: float) -> bool:
    angle = wrapped(a[2] - b[2])
    square: float = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + angle * angle
    return square < radius * radius


@njit(cache=True, nogil=True)
def _place(x: Array, pose: Array, wall: WallShape) -> None:
    """Give a particle (4,) a pose (3,), in place, or as much of the way there as is within the wall."""
    d_1, d_2 = pose[0] - x[0], pose[1] - x[1]
    step = step_within(wall, x[0], x[1], d_1, d_2)
    x[0] += step * d_1
    x[1] += step * d_2
    x[2] = wrapped(pose[2])
