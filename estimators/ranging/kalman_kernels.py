"""The extended Kalman filter of a unicycle that reads ranges, compiled.

The state is the pose with the scale error of the odometry, (x_1, x_2, phi, b): u = (1 - b) u_measured + white noise of
variances W = diag(w_1, w_2) per reading, b constant. With F, G the derivatives of the exact motion f over dt,

    x <- f(x, (1 - b) u),   P <- A P A' + G W G',   A = [F, -G u; 0, 1].

Ray i reads rho_i = h_i(x) + noise of variance r_i = (relative h_i)^2 + absolute^2 + tr(h_i'' P- h_i'' P-) / 2, P- being
the prediction's covariance, independent of the others, so that conditioning on one ray after the other, all linearised
at the prediction, equals the update with all of them at once, in any order:

    nu_i = rho_i - h_i - H_i (x - x_predicted),   s_i = H_i P H_i' + r_i,
    x <- x + P H_i' nu_i / s_i,   P <- P - P H_i' H_i P / s_i,   NIS = sum nu_i^2 / s_i.

The last term of r_i is the variance of the linearisation error, for a Gaussian error of covariance P-. It is negligible
once the filter has converged, and until then keeps the filter from being overconfident.

A share epsilon of the ranges are outliers, uniform up to the longest range L in sight. A reading is not an outlier with
the probability beta (probabilistic data association, Bar-Shalom and Tse, 1975), which weights the update:

    p_i = (1 - epsilon) N(nu_i; 0, s_i),   beta_i = p_i / (p_i + epsilon / L),   ln L = sum ln (p_i + epsilon / L),
    x <- x + beta_i P H_i' nu_i / s_i,
    P <- P - (beta_i - beta_i (1 - beta_i) nu_i^2 / s_i) P H_i' H_i P / s_i.

With epsilon = 0 that is the extended Kalman filter. A ray that was lost is skipped; one with nu_i^2 / s_i above the
gate counts as one at the gate in NIS.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.kernels import WallShape, cast_ray, curve_second_derivative, curve_tangent, is_inside
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, mounted, wrapped

GRAZING = 1e-3
"""sine of the angle between a ray and the wall below which it has no information"""
_HALVINGS = 30  # of a step that leads out of the wall
_MOST_UNLIKELY = 50.0  # logarithm of the odds of an outlier beyond which it is one


class RaySensors(NamedTuple):
    """Range sensors of a robot and their errors."""

    rays: Array  # (l, 3) [rad, m, m] angle off the heading, and place in the robot's axes
    relative: float  # standard deviation of a range over its length
    absolute: float  # further standard deviation of a range, independent of its length [m]
    gate: float  # nu^2 / s that no reading exceeds in NIS
    outliers: float = 0.0  # epsilon, fraction of single ranges
    longest: float = 1.0  # L [m]

    def noisier(self, sigma: float, outliers: float) -> RaySensors:
        """The sensors with ``sigma`` times their noise, and a share of ``outliers``."""
        return self._replace(relative=sigma * self.relative, absolute=sigma * self.absolute, outliers=outliers)


class Innovations(NamedTuple):
    """Innovations of one update, by ray, NaN of a ray that read nothing; written by ``condition``."""

    residual: Array  # (l,) [m] z - h
    variance: Array  # (l,) [m^2] of the range's noise
    white: Array  # (l,) beta nu / sqrt(s): white with unit variance in a consistent filter
    share: Array  # (l,) of the range's noise in s
    outliers: Integers  # (2,) rays that are outliers rather than not, beta < 1/2: of the update, and of a filter so far
    misfits: Integers  # (2,) rays that the pose after the update does not explain, in a polygon; likewise
    fits: Array  # (2, l) residuals over sqrt(r) at the pose after the update, in a polygon: of the update, and the last
    products: Array  # (2,) sums of products of each with the last one of its ray, and of their squares
    tested: Array  # (2, l) [m] by the prediction alone: z less the expected range, and its standard deviation
    of_best: Array  # (2, l) [m] those of the best filter of a bank


def no_innovations(rays: int) -> Innovations:
    """Empty innovations of one update with ``rays`` rays."""
    residual, variance, white, share = np.full((4, rays), np.nan)
    return Innovations(
        residual, variance, white, share, np.zeros(2, np.int64), np.zeros(2, np.int64),
        np.full((2, rays), np.nan), np.zeros(2), np.full((2, rays), np.nan), np.full((2, rays), np.nan),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def step_within(wall: WallShape, x_1: float, x_2: float, d_1: float, d_2: float) -> float:
    """Share of a step (d_1, d_2) [m] from a point (x_1, x_2) [m] within the wall that stays within it, in [0, 1]."""
    coefficients, polyline = wall
    step = 1.0
    for _ in range(_HALVINGS):
        if is_inside(coefficients, polyline, x_1 + step * d_1, x_2 + step * d_2):
            return step
        step *= 0.5
    return 0.0


@njit(cache=True, nogil=True)
def within(wall: WallShape, points: Array) -> Array:
    """Points (k, 2) [m] of ``points`` (n, 2) [m] that are within the wall."""
    coefficients, polyline = wall
    inside = np.empty(len(points), np.bool_)
    for n in range(len(points)):
        inside[n] = is_inside(coefficients, polyline, points[n, 0], points[n, 1])
    return points[inside]


@njit(cache=True, nogil=True)
def move(x: Array, u: Array, wall: WallShape, dt: float) -> None:
    """Move x (4,), in place, over dt [s] under a reading u (2,) [m/s, rad/s], but not through the wall."""
    after = integrate(x[:3], (1.0 - x[3]) * u[0], (1.0 - x[3]) * u[1], dt)
    d_1, d_2 = after[0] - x[0], after[1] - x[1]
    step = step_within(wall, x[0], x[1], d_1, d_2)
    x[0] += step * d_1
    x[1] += step * d_2
    x[2] = wrapped(after[2])


@njit(cache=True, nogil=True)
def predict(x: Array, P: Array, u: Array, W: Array, wall: WallShape, dt: float) -> None:
    """Predict x (4,) and P (4, 4), in place, over dt [s] under a reading u (2,) of variances W (2,)."""
    F, G = integrate_jacobians(x[:3], (1.0 - x[3]) * u[0], (1.0 - x[3]) * u[1], dt)
    move(x, u, wall, dt)
    for i in range(3):  # A is the identity but for these entries
        by_heading = F[i, 2] if i < 2 else 0.0
        by_scale = -G[i, 0] * u[0] - G[i, 1] * u[1]
        for j in range(4):
            P[i, j] += by_heading * P[2, j] + by_scale * P[3, j]
    for i in range(3):
        by_heading = F[i, 2] if i < 2 else 0.0
        by_scale = -G[i, 0] * u[0] - G[i, 1] * u[1]
        for j in range(4):
            P[j, i] += by_heading * P[j, 2] + by_scale * P[j, 3]
    for i in range(3):
        for j in range(3):
            P[i, j] += G[i, 0] * W[0] * G[j, 0] + G[i, 1] * W[1] * G[j, 1]
    for i in range(4):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@njit(cache=True, nogil=True)
def expected_range(wall: WallShape, x: Array, ray: Array, H: Array, D: Array) -> tuple[float, float, float, float]:
    """h [m] of a ``ray`` (3,) [rad, m, m] from a pose x (3,) and its derivatives; NaN if it has no information.

    With a = (q_1, q_2, phi), q being where the ray begins and s the parameter of the wall where it ends, (C.4) gives

        dq + dh e + h e_perp dphi = theta' ds,   and its derivative,   each multiplied by e_perp or by the normal,

    and q = (x_1, x_2) + R_phi m of a sensor at m, dq = dx_{1,2} + (R_phi m)_perp dphi. Writes H (3,) = dh/dx and D (3,)
    = ds/dx, and returns h, B, C, E of the second derivative h'' = C D D' - B (H e_3' + e_3 H') + E e_3 e_3'; E is h
    less H_{1,2} R_phi m.
    """
    coefficients, polyline = wall
    m_1, m_2 = mounted(ray, x[2])
    beta = x[2] + ray[0]
    h, s = cast_ray(coefficients, polyline, x[0] + m_1, x[1] + m_2, beta)
    if math.isnan(h):
        return math.nan, 0.0, 0.0, 0.0
    t_x, t_y = curve_tangent(coefficients, s)
    e_x, e_y = math.cos(beta), math.sin(beta)
    across, along = e_x * t_y - e_y * t_x, e_x * t_x + e_y * t_y  # theta' in the axes of the ray
    if across * across < GRAZING**2 * (across * across + along * along):
        return math.nan, 0.0, 0.0, 0.0
    H[0], H[1], H[2] = -t_y / across, t_x / across, h * along / across
    D[0], D[1], D[2] = -e_y / across, e_x / across, h / across
    H[2] += H[1] * m_1 - H[0] * m_2
    D[2] += D[1] * m_1 - D[0] * m_2
    b_x, b_y = curve_second_derivative(coefficients, s)
    return h, -along / across, (t_y * b_x - t_x * b_y) / across, h - H[0] * m_1 - H[1] * m_2


@njit(cache=True, nogil=True)
def expected_ranges(wall: WallShape, pose: Array, rays: Array) -> tuple[Array, Array]:
    """Ranges h (l,) [m] of ``rays`` (l, 3) from a pose (3,) and derivatives H (l, 3); NaN without information."""
    h, H, D = np.empty(len(rays)), np.full((len(rays), 3), np.nan), np.empty(3)
    for i in range(len(rays)):
        h[i], _, _, _ = expected_range(wall, pose, rays[i], H[i], D)
    return h, H


@njit(cache=True, nogil=True)
def condition(
    x: Array, P: Array, z: Array, wall: WallShape, sensors: RaySensors, innovations: Innovations
) -> tuple[float, float, int]:
    """Condition x (4,) and P (4, 4), in place, on ranges z (l,) [m] of ``sensors``, NaN where lost.

    A step that would lead out of the wall is cut short. Returns the logarithm of the likelihood, NIS and the number of
    rays that read something.
    """
    rays, relative, absolute, gate, outliers, longest = sensors
    predicted = P[:3, :3].copy()
    dx, H, D, PH = np.zeros(4), np.empty(3), np.empty(3), np.empty(4)
    likelihood, nis, read = 0.0, 0.0, 0
    innovations.outliers[0] = 0
    for i in range(len(z)):
        innovations.residual[i] = innovations.variance[i] = innovations.white[i] = innovations.share[i] = math.nan
        innovations.tested[0, i] = innovations.tested[1, i] = math.nan
        if not z[i] > 0.0:
            continue
        h, B, C, E = expected_range(wall, x, rays[i], H, D)
        if math.isnan(h):
            continue
        for j in range(4):
            PH[j] = P[j, 0] * H[0] + P[j, 1] * H[1] + P[j, 2] * H[2]
        HPH = H[0] * PH[0] + H[1] * PH[1] + H[2] * PH[2]
        r = (relative * h) ** 2 + absolute**2
        by_curvature = 0.5 * square_trace(predicted, D, E, B, C, H)
        s = HPH + r + by_curvature
        predicted_HPH = 0.0
        for j in range(3):
            predicted_HPH += H[j] * (predicted[j, 0] * H[0] + predicted[j, 1] * H[1] + predicted[j, 2] * H[2])
        innovations.tested[0, i], innovations.tested[1, i] = z[i] - h, math.sqrt(predicted_HPH + r + by_curvature)
        nu = z[i] - h - H[0] * dx[0] - H[1] * dx[1] - H[2] * dx[2]
        square = nu * nu / s
        read += 1
        nis += min(square, gate)
        inlier = -0.5 * (square + math.log(2.0 * math.pi * s))
        beta = 1.0
        if outliers > 0.0:
            inlier += math.log(1.0 - outliers)
            odds = math.log(outliers / longest) - inlier
            beta = 0.0 if odds > _MOST_UNLIKELY else 1.0 / (1.0 + math.exp(odds))
            inlier += odds if odds > _MOST_UNLIKELY else math.log1p(math.exp(odds))
        if beta < 0.5:
            innovations.outliers[0] += 1
        likelihood += inlier
        innovations.residual[i], innovations.variance[i] = z[i] - h, r
        innovations.white[i], innovations.share[i] = beta * nu / math.sqrt(s), r / s
        gain = (beta - beta * (1.0 - beta) * square) / s
        for j in range(4):
            dx[j] += beta * PH[j] * nu / s
            for k in range(4):
                P[j, k] -= gain * PH[j] * PH[k]
    step = step_within(wall, x[0], x[1], dx[0], dx[1])
    for j in range(4):
        x[j] += step * dx[j]
    x[2] = wrapped(x[2])
    return likelihood, nis, read


@njit(cache=True, nogil=True)
def square_trace(P: Array, D: Array, E: float, B: float, C: float, H: Array) -> float:
    """tr(h'' P h'' P) with h'' = C D D' - B (H e_3' + e_3 H') + E e_3 e_3'."""
    p_0 = P[0, 0] * H[0] + P[0, 1] * H[1] + P[0, 2] * H[2]
    p_1 = P[1, 0] * H[0] + P[1, 1] * H[1] + P[1, 2] * H[2]
    HPe = P[2, 0] * H[0] + P[2, 1] * H[1] + P[2, 2] * H[2]
    HPH = H[0] * p_0 + H[1] * p_1 + H[2] * HPe
    q_0 = P[0, 0] * D[0] + P[0, 1] * D[1] + P[0, 2] * D[2]
    q_1 = P[1, 0] * D[0] + P[1, 1] * D[1] + P[1, 2] * D[2]
    DPe = P[2, 0] * D[0] + P[2, 1] * D[1] + P[2, 2] * D[2]
    DPD = D[0] * q_0 + D[1] * q_1 + D[2] * DPe
    DPH = H[0] * q_0 + H[1] * q_1 + H[2] * DPe
    ePe = P[2, 2]
    trace: float = (C * DPD) ** 2 + (E * ePe) ** 2 + 2.0 * B * B * (HPe * HPe + HPH * ePe)
    trace += 2.0 * C * E * DPe * DPe - 4.0 * B * (C * DPH * DPe + E * ePe * HPe)
    return trace
