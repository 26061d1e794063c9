"""Spaces of constant curvature k = +1 (the sphere S^n), -1 (hyperbolic space H^n) and 0 (R^n), compiled.

Points and vectors are ambient: S^n and H^n are the sets <p, p> = k of R^(n+1), where <, > is the Euclidean product for
the sphere and Minkowski's, diag(-1, 1, ..., 1), for hyperbolic space, whose points have p_0 > 0. Vectors at p are those
with <p, w> = 0. With c = k <p, q> = cos theta or cosh theta,

    log_p q = (theta / sin theta) (q - c p),        1 - c = k |q - p|^2 / 2,
    exp_p w = cos |w| p + (sin |w| / |w|) w,
    PT_{p -> q} w = w - k <q, w> / (1 + c) (p + q),

with sinh and cosh in hyperbolic space. Written so, nothing is lost where q is near p. From a point of the sphere to the
one opposite, where the geodesic is not unique, logarithm and transport are NaN.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array

_SMALL = 1e-8  # [rad] below which sin(a) / a is 1 in doubles
_OPPOSITE = 1e-7  # [rad] from the opposite point, within which rounding would say which way is the shortest


@njit(cache=True, nogil=True)
def inner(k: float, u: Array, w: Array) -> float:
    """Inner product <u, w> of ambient vectors u, w (m,)."""
    total: float = -u[0] * w[0] if k < 0.0 else u[0] * w[0]
    for i in range(1, len(u)):
        total += u[i] * w[i]
    return total


@njit(cache=True, nogil=True)
def norm(k: float, w: Array) -> float:
    """Length |w| of a tangent vector w (m,)."""
    return math.sqrt(max(0.0, inner(k, w, w)))


@njit(cache=True, nogil=True)
def project(k: float, p: Array) -> Array:
    """Project p (m,), which rounding has moved off the space, back onto it.

    The result (m,) is on the ray through p; above or below p where k < 0; p itself in R^n.
    """
    point = p.copy()
    if k > 0.0:
        point /= math.sqrt(inner(k, p, p))
    elif k < 0.0:  # <p, p> of a point far out is the small difference of large numbers
        point[0] = math.sqrt(1.0 + inner(1.0, p[1:], p[1:]))
    return point


@njit(cache=True, nogil=True)
def tangent(k: float, p: Array, w: Array) -> Array:
    """Tangential part (m,) at p (m,) of an ambient vector w (m,)."""
    return w - (k * inner(k, p, w)) * p


@njit(cache=True, nogil=True)
def distance(k: float, p: Array, q: Array) -> float:
    """Geodesic distance theta of p, q (m,): 2 atan2(|q - p|, |q + p|), 2 asinh(|q - p| / 2), |q - p|."""
    chord = norm(k, q - p)
    if k > 0.0:
        return 2.0 * math.atan2(chord, norm(k, q + p))
    return 2.0 * math.asinh(0.5 * chord) if k < 0.0 else chord


@njit(cache=True, nogil=True)
def logarithm(k: float, p: Array, q: Array) -> Array:
    """log_p q (m,) of points p, q (m,); NaN from a point of the sphere to the one opposite."""
    difference = q - p
    if k == 0.0:
        return difference
    w = tangent(k, p, difference + (0.5 * k * inner(k, difference, difference)) * p)
    theta, sine = distance(k, p, q), norm(k, w)
    if theta < _SMALL:
        return w
    if k > 0.0 and math.pi - theta < _OPPOSITE:
        return np.full(len(p), np.nan)
    return w * (theta / sine)


@njit(cache=True, nogil=True)
def exponential(k: float, p: Array, w: Array) -> Array:
    """exp_p w (m,) of a tangent vector w (m,) at p (m,)."""
    if k == 0.0:
        return p + w
    theta = norm(k, w)
    c, s = (math.cos(theta), math.sin(theta)) if k > 0.0 else (math.cosh(theta), math.sinh(theta))
    ratio = s / theta if theta > _SMALL else 1.0
    return project(k, c * p + ratio * w)


@njit(cache=True, nogil=True)
def transport(k: float, p: Array, q: Array, w: Array) -> Array:
    """Parallel transport PT_{p -> q} w (m,) along the shortest geodesic; NaN to the opposite point of the sphere."""
    if k == 0.0:
        return w.copy()
    if k > 0.0 and math.pi - distance(k, p, q) < _OPPOSITE:
        return np.full(len(p), np.nan)
    both = 1.0 + k * inner(k, p, q)
    return tangent(k, q, w - (k * inner(k, q - p, w) / both) * (p + q))


@njit(cache=True, nogil=True)
def curvature(k: float, eta: Array, G: Array) -> Array:
    """R (n,) = I(R(., G)) (eta) = k (<eta, G> eta - |eta|^2 G), the curvature term of (D.6) by (D.13); eta, G (n,)."""
    return k * (inner(k, eta, G) * eta - inner(k, eta, eta) * G)
