"""Uniform cubic B-splines, and the length-to-go on them.

Coefficients by a recursive filter, evaluation by compiled kernels. A spline on the nodes 0 ... n - 1 has the
coefficients c[-1] ... c[n], stored with an offset of one. The boundary is mirrored, so the slope across an edge of the
grid is zero there and holding the coordinate at the edge continues the function with a continuous derivative.

**Length-to-go of the factored cost, compiled**: the shape of Psi without its factor beta / v_c (see ``cost_to_go``).

    L(p) = sqrt(|p - p_f|^2 + l^2) tau(p) - l,

tau a tricubic spline in the stretched coordinates (layer, row, column). The array arguments are those of
``cost_to_go.FactoredCost``: spline coefficients of the grid's ground and of tau, and ``scales`` (8,).
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array

_POLE = -0.26794919243112270  # sqrt(3) - 2, of the filter whose inverse samples a cubic B-spline at its nodes


def coefficients(values: Array) -> Array:
    """Coefficients (m + 2, n + 2) of the interpolating spline of node values (m, n), or of any other number of axes.

    The bits are those of ``scipy.ndimage.spline_filter`` with a mirrored boundary, which takes as long to import as a
    short flight to fly.
    """
    c = np.array(values, dtype=np.float64)
    for axis in range(c.ndim):
        along = np.ascontiguousarray(np.moveaxis(c, axis, 0))
        if len(along) > 1:
            _filter(along)
        c = np.moveaxis(along, 0, axis)
    return np.ascontiguousarray(np.pad(c, 1, mode="reflect"))


def _filter(c: Array) -> None:
    """Turn node values (n, ...), n >= 2, into coefficients along the first axis, in place.

    The interpolation condition c[i - 1] + 4 c[i] + c[i + 1] = 6 f[i] is solved by one recursion forwards and one
    backwards (Unser, Aldroubi and Eden, IEEE Trans. Signal Processing 41(2), 1993), begun as the mirrored values say.
    """
    n, z = len(c), _POLE
    last, weight = z ** (n - 1), z
    c *= (1.0 - z) * (1.0 - 1.0 / z)
    c[0] += last * c[n - 1]
    for i in range(1, n - 1):
        c[0] += weight * (c[i] + last * c[n - 1 - i])
        weight *= z
    c[0] /= 1.0 - last * last
    for i in range(1, n):
        c[i] += z * c[i - 1]
    c[n - 1] = (z * c[n - 2] + c[n - 1]) * z / (z * z - 1.0)
    for i in range(n - 2, -1, -1):
        c[i] = z * (c[i + 1] - c[i])


def knots(count: int) -> list[float]:
    """Knots for ``count`` nodes in the convention of a general B-spline routine of degree three."""
    return [float(k) for k in range(-3, count + 3)]


@inner_njit(nogil=True)
def _basis(f: float) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Values, first and second derivatives of the four cubic basis functions at the fraction f of a cell."""
    g = 1.0 - f
    value = (
        g * g * g / 6.0,
        (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0,
        (4.0 - 6.0 * g * g + 3.0 * g * g * g) / 6.0,
        f * f * f / 6.0,
    )
    first = (-0.5 * g * g, -2.0 * f + 1.5 * f * f, 2.0 * g - 1.5 * g * g, 0.5 * f * f)
    second = (g, -2.0 + 3.0 * f, -2.0 + 3.0 * g, f)
    return value, first, second


@inner_njit(nogil=True)
def _cell(u: float, nodes: int) -> tuple[int, float, float]:
    """Cell and fraction of the coordinate u clipped to [0, nodes - 1], and the derivative of the clipping (1 or 0)."""
    if u <= 0.0:
        return 0, 0.0, 0.0
    if u >= nodes - 1.0:
        return nodes - 2, 1.0, 0.0
    i = min(int(u), nodes - 2)
    return i, u - i, 1.0


@inner_njit(nogil=True)
def surface(c: Array, u: float, v: float) -> tuple[float, float, float]:
    """Spline over (row u, column v): value and derivatives with respect to u and v."""
    i, fu, hu = _cell(u, c.shape[0] - 2)
    j, fv, hv = _cell(v, c.shape[1] - 2)
    wu, du, _ = _basis(fu)
    wv, dv, _ = _basis(fv)
    value = slope_u = slope_v = 0.0
    for k in range(4):
        along = across = 0.0
        for m in range(4):
            along += c[i + k, j + m] * wv[m]
            across += c[i + k, j + m] * dv[m]
        value += wu[k] * along
        slope_u += du[k] * along
        slope_v += wu[k] * across
    return value, hu * slope_u, hv * slope_v


@inner_njit(nogil=True)
def surface_curvature(c: Array, u: float, v: float) -> tuple[float, float, float]:
    """Second derivatives uu, uv, vv of ``surface`` with coefficients c (m + 2, n + 2) at u, v in nodes."""
    i, fu, hu = _cell(u, c.shape[0] - 2)
    j, fv, hv = _cell(v, c.shape[1] - 2)
    wu, du, su = _basis(fu)
    wv, dv, sv = _basis(fv)
    uu = uv = vv = 0.0
    for k in range(4):
        for m in range(4):
            coefficient = c[i + k, j + m]
            uu += su[k] * wv[m] * coefficient
            uv += du[k] * dv[m] * coefficient
            vv += wu[k] * sv[m] * coefficient
    return hu * uu, hu * hv * uv, hv * vv


@inner_njit(nogil=True)
def volume(c: Array, u: float, v: float, w: float, gradient: Array, hessian: Array) -> float:
    """Spline over (layer u, row v, column w): value; fills the gradient (3,) and the Hessian (3, 3)."""
    i, fu, hu = _cell(u, c.shape[0] - 2)
    j, fv, hv = _cell(v, c.shape[1] - 2)
    k, fw, hw = _cell(w, c.shape[2] - 2)
    wu, du, su = _basis(fu)
    wv, dv, sv = _basis(fv)
    ww, dw, sw = _basis(fw)
    value = gu = gv = gw = uu = uv = uw = vv = vw = ww_ = 0.0
    for a in range(4):
        for b in range(4):
            line = slope = second_derivative = 0.0
            for m in range(4):
                coefficient = c[i + a, j + b, k + m]
                line += coefficient * ww[m]
                slope += coefficient * dw[m]
                second_derivative += coefficient * sw[m]
            value += wu[a] * wv[b] * line
            gu += du[a] * wv[b] * line
            gv += wu[a] * dv[b] * line
            gw += wu[a] * wv[b] * slope
            uu += su[a] * wv[b] * line
            uv += du[a] * dv[b] * line
            uw += du[a] * wv[b] * slope
            vv += wu[a] * sv[b] * line
            vw += wu[a] * dv[b] * slope
            ww_ += wu[a] * wv[b] * second_derivative
    gradient[0], gradient[1], gradient[2] = hu * gu, hv * gv, hw * gw
    hessian[0, 0], hessian[1, 1], hessian[2, 2] = hu * uu, hv * vv, hw * ww_
    hessian[0, 1] = hessian[1, 0] = hu * hv * uv
    hessian[0, 2] = hessian[2, 0] = hu * hw * uw
    hessian[1, 2] = hessian[2, 1] = hv * hw * vw
    return value


TARGET_LENGTH = 50.0  # [m] l: within it the distance to the target is rounded off


@inner_njit(nogil=True)
def length_to_go(
    ground: Array, ratio: Array, scales: Array, x: float, y: float, z: float, gradient: Array, hessian: Array
) -> float:
    """sqrt(|p - p_f|^2 + l^2) tau(p) - l [m]; fills its gradient (3,) and Hessian (3, 3)."""
    x_0, y_0, spacing, level_0, layer_spacing = scales[0], scales[1], scales[2], scales[3], scales[4]
    v, w = (y - y_0) / spacing, (x - x_0) / spacing
    floor, floor_v, floor_w = surface(ground, v, w)
    floor_vv, floor_vw, floor_ww = surface_curvature(ground, v, w)
    u = (z - floor - level_0) / layer_spacing
    dt = np.empty(3)
    ddt = np.empty((3, 3))
    tau = volume(ratio, u, v, w, dt, ddt)
    # Chain rule from (u, v, w) to (x, y, z); u depends on all three.
    jacobian = np.empty((3, 3))
    jacobian[:] = 0.0
    jacobian[0, 0], jacobian[0, 1] = -floor_w / (spacing * layer_spacing), -floor_v / (spacing * layer_spacing)
    jacobian[0, 2] = 1.0 / layer_spacing
    jacobian[1, 1] = jacobian[2, 0] = 1.0 / spacing
    tau_p = np.empty(3)
    tau_pp = np.empty((3, 3))
    for a in range(3):
        tau_p[a] = tau_pp[a, 0] = tau_pp[a, 1] = tau_pp[a, 2] = 0.0
        for k in range(3):
            tau_p[a] += jacobian[k, a] * dt[k]
            for b in range(3):
                for m in range(3):
                    tau_pp[a, b] += jacobian[k, a] * ddt[k, m] * jacobian[m, b]
    floor_factor = -dt[0] / (spacing * spacing * layer_spacing)
    tau_pp[0, 0] += floor_factor * floor_ww
    tau_pp[0, 1] += floor_factor * floor_vw
    tau_pp[1, 0] += floor_factor * floor_vw
    tau_pp[1, 1] += floor_factor * floor_vv
    d = np.empty(3)
    d[0], d[1], d[2] = x - scales[5], y - scales[6], z - scales[7]
    r = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + TARGET_LENGTH * TARGET_LENGTH)
    for a in range(3):
        gradient[a] = tau * d[a] / r + r * tau_p[a]
        for b in range(3):
            identity = 1.0 if a == b else 0.0
            hessian[a, b] = (
                tau * (identity - d[a] * d[b] / (r * r)) / r
                + (d[a] * tau_p[b] + tau_p[a] * d[b]) / r
                + r * tau_pp[a, b]
            )
    return r * tau - TARGET_LENGTH


@njit(cache=True, nogil=True)
def cost_many(ground: Array, ratio: Array, scales: Array, points: Array) -> tuple[Array, Array]:
    """Length-to-go (n,) [m] and its gradient (n, 3) at (n, 3) points [m]."""
    values = np.empty(points.shape[0])
    gradients = np.empty((points.shape[0], 3))
    hessian = np.empty((3, 3))
    for i in range(points.shape[0]):
        values[i] = length_to_go(ground, ratio, scales, points[i, 0], points[i, 1], points[i, 2], gradients[i], hessian)
    return values, gradients
