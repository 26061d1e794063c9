"""Ranges and range rates at the centre of a window of readings, compiled (see ``observer``)."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.observer_kernels import kept_within
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, cast_ray, cast_rays, range_gradient
from mathnavi.models.unicycle.kernels import integrate

_FAR = 4.0  # root mean squares of the residuals: a sample further off the polynomial is an outlier
_EXACT = 1e-9  # [m] of a residual that is round-off


WindowFit = tuple[Array, Array, float]
"""weights (p + 1, 2 m + 1) of ``savitzky_golay``, ``spread`` (2 m + 1, 2 k + 1), and the period of the readings [s]"""


@njit(cache=True, nogil=True)
def centre_fit(samples: Array, weights: Array) -> tuple[float, float, bool]:
    """Fit a polynomial to ``samples`` (2 m + 1,) at tau = -1, ..., 1: its value and its derivative by tau at tau = 0,
    and whether the sample at the centre was left out as one that is far off.

    ``weights`` (p + 1, 2 m + 1) give its coefficients if no sample is missing. NaN samples are left out, and so are
    samples far off a first fit. Returns NaN, NaN if too many are missing.
    """
    n, missing = len(samples), 0
    for j in range(n):
        missing += math.isnan(samples[j])
    if missing == 0:
        a = weights @ samples
    elif _is_enough(samples, len(weights)):
        a = _fit(samples, len(weights))
    else:
        return math.nan, math.nan, False
    residual, squares = np.empty(n), 0.0
    for j in range(n):
        residual[j] = samples[j] - _polynomial(a, _tau(j, n))
        if not math.isnan(residual[j]):
            squares += residual[j] * residual[j]
    limit, far = _FAR * math.sqrt(squares / (n - missing)) + _EXACT, 0
    for j in range(n):
        if abs(residual[j]) > limit:
            residual[j], far = math.nan, far + 1
        elif not math.isnan(residual[j]):
            residual[j] = samples[j]
    refused = False
    if far > 0 and _is_enough(residual, len(weights)):
        a = _fit(residual, len(weights))
        refused = math.isnan(residual[n // 2]) and not math.isnan(samples[n // 2])
    return a[0], a[1], refused


@njit(cache=True, nogil=True)
def measured(ranges: Array, weights: Array, period: float) -> Array:
    """Readings (3, l) at the centre of ``ranges`` (2 m + 1, l), taken every ``period`` [s]: rho [m], rho_dot [m/s], and
    1 for a ray whose reading at the centre the fit left out, else 0.

    ``weights`` (p + 1, 2 m + 1) are those of ``savitzky_golay``. If the window has too few readings of a ray, rho is
    the reading at its centre, or NaN, and rho_dot is NaN.
    """
    n, l = ranges.shape  # noqa: E741
    readings = np.empty((3, l))
    for i in range(l):
        value, slope, refused = centre_fit(ranges[:, i].copy(), weights)
        readings[0, i] = value if not math.isnan(value) else ranges[n // 2, i]
        readings[1, i] = slope / (period * (n // 2))
        readings[2, i] = 1.0 if refused else 0.0
    return readings


@njit(cache=True, nogil=True)
def innovated(
    ranges: Array, inputs: Array, u: Array, fit: WindowFit, wall: WallShape, alpha: Array, pose: Array
) -> Array:
    """Readings (3, l) as of ``measured``, but fitted to the innovation.

    The innovation is the difference of the ``ranges`` (2 m + 1, l) from those expected of a robot that is at ``pose``
    (3,) at the window's centre and has the ``inputs`` (2 m, 2) between the readings; ``u`` (2,) is the one at the
    centre. Rays are cast at 2 k + 1 instants only, from which the fit's ``spread`` interpolates.
    """
    coefficients, polyline = wall
    weights, spread, period = fit
    n, l = ranges.shape  # noqa: E741
    m, k = n // 2, spread.shape[1] // 2
    cast = np.empty((2 * k + 1, l))
    rho, s = cast_rays(coefficients, polyline, pose, alpha)
    cast[k] = rho
    for way in (-1, 1):
        at = pose
        for j in range(m):
            held = inputs[m + j] if way > 0 else inputs[m - 1 - j]
            at = integrate(at, held[0], held[1], way * period)
            if (j + 1) % (m // k) == 0:
                x, y = kept_within(wall, at[0], at[1])
                for i in range(l):
                    rho_i, _ = cast_ray(coefficients, polyline, x, y, at[2] + alpha[i])
                    cast[k + way * (j + 1) // (m // k), i] = rho_i
    expected = spread @ cast
    readings = np.empty((3, l))
    for i in range(l):
        value, slope, refused = centre_fit(ranges[:, i] - expected[:, i], weights)
        by_x, by_y, by_phi = range_gradient(coefficients, s[i], rho[i], pose[2] + alpha[i])
        rate = u[0] * (by_x * math.cos(pose[2]) + by_y * math.sin(pose[2])) + u[1] * by_phi
        readings[0, i] = rho[i] + value if not math.isnan(value) else ranges[m, i]
        readings[1, i] = rate + slope / (period * m) if math.isfinite(rate) else math.nan
        readings[2, i] = 1.0 if refused else 0.0
    return readings


@inner_njit(nogil=True)
def _tau(j: int, n: int) -> float:
    return (j - n // 2) / (n // 2)


@inner_njit(nogil=True)
def _polynomial(a: Array, tau: float) -> float:
    value = 0.0
    for k in range(len(a) - 1, -1, -1):
        value = value * tau + a[k]
    return value


@inner_njit(nogil=True)
def _is_enough(samples: Array, terms: int) -> bool:
    """True if a quarter of either half was read, and enough for ``terms`` coefficients."""
    m = len(samples) // 2
    before = after = 0
    for j in range(m):
        before += not math.isnan(samples[j])
        after += not math.isnan(samples[m + 1 + j])
    return 4 * min(before, after) >= m and before + after + (not math.isnan(samples[m])) >= terms


@njit(cache=True, nogil=True)
def _fit(samples: Array, terms: int) -> Array:
    """Coefficients (p + 1,) of the polynomial in tau that fits the samples best, missing ones left out."""
    n = len(samples)
    normal, right, powers = np.zeros((terms, terms)), np.zeros(terms), np.empty(terms)
    for j in range(n):
        if not math.isnan(samples[j]):
            tau, power = _tau(j, n), 1.0
            for k in range(terms):
                powers[k] = power
                power *= tau
            for k in range(terms):
                right[k] += powers[k] * samples[j]
                for i in range(terms):
                    normal[k, i] += powers[k] * powers[i]
    return np.linalg.solve(normal, right).astype(np.float64)
