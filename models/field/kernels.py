"""A wall and the rays that end on it, compiled: estimators compute thousands of them.

A wall is a closed smooth curve or, told by the width of its table, a polygon with holes (``polygon_kernels``). The
curve is theta(s) = sum_k a_k cos ks + b_k sin ks, its coefficients (K + 1, 4) in the columns a_x, b_x, a_y, b_y;
``polyline`` (n + 1, 2) are its points at s = 2 pi k / n. A ray from p along e = (cos beta, sin beta) ends where

    theta(s) = p + rho e,   rho > 0 the least.                                                             (C.4)

For an ellipse (K = 1) that is a quadratic equation. Otherwise the polyline brackets the root of e x (theta(s) - p), its
points being on the curve, and safeguarded Newton steps find it; two crossings within one segment, where a ray grazes
the wall, are passed over. In every kernel ``coefficients`` and ``polyline`` are those of the curve, or the table of
segments of a polygon and its corners, which only bound it; s is then the number of a segment and the share along it.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.polygon_kernels import (
    is_polygonal,
    is_within_segments,
    segment_distance,
    segment_point,
    segment_ray,
    segment_tangent,
)

_STEPS = 60  # bisections at most; Newton needs three
_PRECISION = 4e-15  # of s: what rounding leaves of a sum of harmonics

WallShape = tuple[Array, Array]
"""coefficients (K + 1, 4) [m] and polyline (n + 1, 2) [m] of a closed curve, or table of segments (m, 8) and corners
(n + 1, 2) [m] of a polygon with holes"""


@njit(cache=True, nogil=True)
def curve_point(coefficients: Array, s: float) -> tuple[float, float]:
    """Point theta(s) [m] of a curve with ``coefficients`` (K + 1, 4)."""
    if is_polygonal(coefficients):
        return segment_point(coefficients, s)
    x, y = coefficients[0, 0], coefficients[0, 2]
    for k in range(1, len(coefficients)):
        c, sn = math.cos(k * s), math.sin(k * s)
        x += coefficients[k, 0] * c + coefficients[k, 1] * sn
        y += coefficients[k, 2] * c + coefficients[k, 3] * sn
    return x, y


@njit(cache=True, nogil=True)
def curve_tangent(coefficients: Array, s: float) -> tuple[float, float]:
    """Derivative theta'(s) [m] of a curve with ``coefficients`` (K + 1, 4)."""
    if is_polygonal(coefficients):
        return segment_tangent(coefficients, s)
    x = y = 0.0
    for k in range(1, len(coefficients)):
        c, sn = k * math.cos(k * s), k * math.sin(k * s)
        x += coefficients[k, 1] * c - coefficients[k, 0] * sn
        y += coefficients[k, 3] * c - coefficients[k, 2] * sn
    return x, y


@njit(cache=True, nogil=True)
def curve_second_derivative(coefficients: Array, s: float) -> tuple[float, float]:
    """Second derivative theta''(s) [m] of a curve with ``coefficients`` (K + 1, 4); 0 on a polygon."""
    if is_polygonal(coefficients):
        return 0.0, 0.0
    x = y = 0.0
    for k in range(1, len(coefficients)):
        c, sn = k * k * math.cos(k * s), k * k * math.sin(k * s)
        x -= coefficients[k, 0] * c + coefficients[k, 1] * sn
        y -= coefficients[k, 2] * c + coefficients[k, 3] * sn
    return x, y


@inner_njit(nogil=True)
def _point_and_tangent(coefficients: Array, s: float) -> tuple[float, float, float, float]:
    """theta(s) [m] and theta'(s) [m], with the cosines and sines of ks by the addition theorem."""
    c_1, s_1 = math.cos(s), math.sin(s)
    c, sn = 1.0, 0.0
    x, y, t_x, t_y = coefficients[0, 0], coefficients[0, 2], 0.0, 0.0
    for k in range(1, len(coefficients)):
        c, sn = c * c_1 - sn * s_1, sn * c_1 + c * s_1
        x += coefficients[k, 0] * c + coefficients[k, 1] * sn
        y += coefficients[k, 2] * c + coefficients[k, 3] * sn
        t_x += k * (coefficients[k, 1] * c - coefficients[k, 0] * sn)
        t_y += k * (coefficients[k, 3] * c - coefficients[k, 2] * sn)
    return x, y, t_x, t_y


@njit(cache=True, nogil=True)
def is_inside(coefficients: Array, polyline: Array, x: float, y: float) -> bool:
    """True if (x, y) [m] lies within the curve: ``coefficients`` (K + 1, 4), ``polyline`` (n + 1, 2).

    Between its chords and the curve itself the answer may be either.
    """
    if is_polygonal(coefficients):
        return is_within_segments(coefficients, x, y)
    if len(coefficients) == 2:
        xi, eta = _to_circle(coefficients, x - coefficients[0, 0], y - coefficients[0, 2])
        return xi * xi + eta * eta < 1.0
    inside = False
    for k in range(len(polyline) - 1):
        xa, ya, xb, yb = polyline[k, 0], polyline[k, 1], polyline[k + 1, 0], polyline[k + 1, 1]
        if (ya > y) != (yb > y) and x < xa + (y - ya) / (yb - ya) * (xb - xa):
            inside = not inside
    return inside


@njit(cache=True, nogil=True)
def wall_distance(coefficients: Array, polyline: Array, x: float, y: float) -> float:
    """Distance [m] from (x, y) [m] to the chords of a curve, or to a polygon."""
    if is_polygonal(coefficients):
        return segment_distance(coefficients, x, y)
    square = math.inf
    for k in range(len(polyline) - 1):
        ax, ay = polyline[k, 0], polyline[k, 1]
        dx, dy = polyline[k + 1, 0] - ax, polyline[k + 1, 1] - ay
        along = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)))
        ex, ey = ax + along * dx - x, ay + along * dy - y
        square = min(square, ex * ex + ey * ey)
    return math.sqrt(square)


@inner_njit(nogil=True)
def cast_ray(coefficients: Array, polyline: Array, x: float, y: float, beta: float) -> tuple[float, float]:
    """Cast a ray from (x, y) [m] along ``beta`` [rad]: its length rho [m] and where it ends, s in [0, 2 pi); see (C.4).

    ``coefficients`` (K + 1, 4), ``polyline`` (n + 1, 2). NaN, NaN where the ray misses the wall.
    """
    ex, ey = math.cos(beta), math.sin(beta)
    if is_polygonal(coefficients):
        return segment_ray(coefficients, x, y, ex, ey)
    if len(coefficients) == 2:
        return _ellipse_ray(coefficients, x, y, ex, ey)
    n = len(polyline) - 1
    rho, found = math.inf, math.nan
    before = ex * (polyline[0, 1] - y) - ey * (polyline[0, 0] - x)
    for k in range(n):
        qx, qy = polyline[k + 1, 0] - x, polyline[k + 1, 1] - y
        after = ex * qy - ey * qx
        if (before < 0.0) != (after < 0.0):
            px, py = polyline[k, 0] - x, polyline[k, 1] - y
            near = min(ex * px + ey * py, ex * qx + ey * qy)  # neither end of the segment is nearer along the ray
            far = max(ex * px + ey * py, ex * qx + ey * qy)
            if far > 0.0 and near < rho:
                s = _root(coefficients, x, y, ex, ey, 2.0 * math.pi * k / n, 2.0 * math.pi * (k + 1) / n, before)
                cx, cy = curve_point(coefficients, s)
                distance = ex * (cx - x) + ey * (cy - y)
                if 0.0 < distance < rho:
                    rho, found = distance, s
        before = after
    if math.isnan(found):
        return math.nan, math.nan
    return rho, found % (2.0 * math.pi)


@njit(cache=True, nogil=True)
def cast_rays(coefficients: Array, polyline: Array, pose: Array, angles: Array) -> tuple[Array, Array]:
    """Cast rays at ``angles`` (l,) [rad] off the heading of ``pose`` (3,) [m, m, rad].

    Returns rho (l,) [m] and s (l,) [rad].
    """
    rho, s = np.empty(len(angles)), np.empty(len(angles))
    for i in range(len(angles)):
        rho[i], s[i] = cast_ray(coefficients, polyline, pose[0], pose[1], pose[2] + angles[i])
    return rho, s


@njit(cache=True, nogil=True)
def range_gradient(coefficients: Array, s: float, rho: float, beta: float) -> tuple[float, float, float]:
    """d rho / d (x_1, x_2, phi) of a ray along ``beta`` [rad] that ends at theta(s); infinite where it grazes.

    From (C.4), with the normal n = R_{-pi/2} theta'(s): n'(dx + d rho e + rho e' d phi) = 0.
    """
    tx, ty = curve_tangent(coefficients, s)
    ex, ey = math.cos(beta), math.sin(beta)
    along = ty * ex - tx * ey
    if along == 0.0:
        return math.inf, math.inf, math.inf
    return -ty / along, tx / along, rho * (ty * ey + tx * ex) / along


@inner_njit(nogil=True)
def _to_circle(coefficients: Array, x: float, y: float) -> tuple[float, float]:
    """(xi, eta) with (x, y) = a_1 xi + b_1 eta: the ellipse becomes the unit circle."""
    ax, bx, ay, by = coefficients[1, 0], coefficients[1, 1], coefficients[1, 2], coefficients[1, 3]
    area = ax * by - bx * ay
    return (by * x - bx * y) / area, (ax * y - ay * x) / area


@inner_njit(nogil=True)
def _ellipse_ray(coefficients: Array, x: float, y: float, ex: float, ey: float) -> tuple[float, float]:
    px, py = _to_circle(coefficients, x - coefficients[0, 0], y - coefficients[0, 2])
    dx, dy = _to_circle(coefficients, ex, ey)
    a, b, c = dx * dx + dy * dy, px * dx + py * dy, px * px + py * py - 1.0
    discriminant = b * b - a * c
    if discriminant < 0.0:
        return math.nan, math.nan
    root = math.sqrt(discriminant)
    # Of the two forms of a root, the one in which nothing cancels.
    exit_ = (root - b) / a if b <= 0.0 else -c / (b + root)
    entry = -(b + root) / a if b >= 0.0 else c / (root - b)
    rho = entry if entry > 0.0 else exit_
    if not rho > 0.0:
        return math.nan, math.nan
    return rho, math.atan2(py + rho * dy, px + rho * dx) % (2.0 * math.pi)


@njit(cache=True, nogil=True)
def _root(
    coefficients: Array, x: float, y: float, ex: float, ey: float, low: float, high: float, at_low: float
) -> float:
    """The zero of e x (theta(s) - p) between ``low`` and ``high``, of opposite signs there."""
    s = 0.5 * (low + high)
    for _ in range(_STEPS):
        cx, cy, tx, ty = _point_and_tangent(coefficients, s)
        value, slope = ex * (cy - y) - ey * (cx - x), ex * ty - ey * tx
        if (value < 0.0) == (at_low < 0.0):
            low = s
        else:
            high = s
        step = s - value / slope if slope != 0.0 else math.inf
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - s) <= _PRECISION * max(1.0, abs(s)):
            return step
        s = step
    return s
