"""Covariance of the errors of the observer (C.5): it has gains and no covariance.

Near the truth its errors follow its own linearisation. With e_z the error of z at the window's centre, e_x that of the
pose there, which counts where rays are lost, n the errors of the fitted ranges, n' those of the fitted range rates,
and u the input,

    (e_z, e_x)^+ = D_e (e_z, e_x) + D_n n + D_n' n' + D_u (b u + w) + d,

where D are the derivatives of one whole step of the observer, feed-forward, correction and Phi, by differences. The
scale error b of the odometry, whose sign no one knows, is a state of the recursion that no reading corrects; w is
white.

**Errors of a fit.** Readings of variance sigma^2 that are fitted over a window are no longer white. The error of the
value has the variance sigma^2 w_0 and that of the slope sigma^2 w_1, w_k being the sums of squares of the fit's
weights, and for slow motions the value is as uncertain as single readings are, a density of sigma^2 dt. The process

    n'' + 2 zeta omega n' + omega^2 n = white noise,    omega^2 = w_1 / w_0,   zeta = omega dt / (4 w_0),

has all three (omega = sqrt(12) / T and zeta = sqrt(3) / 2 for a straight line over T), so that each ray has two states.

**What a feed-forward lacks.** On the truth, the step errs by d, its difference from the step with the exact
feed-forward. It is no chance: its mean error m follows m^+ = D_e m + d, and second moments of the error are
P + m m'. So the observer as printed, which lags, declares how much it lags.

**Does it hold?** The fitted ranges and rates r differ from those that are expected at the pose by T (e_x, n, n', b),
whose variances follow from the recursion, whatever correlations the errors have in time. Where one of them is beyond
three deviations for long, the observer has lost lock, or a reading is not as declared. Where what is fitted is off from
readings that odometry has led to, its noise adds to r too: away from the centre the robot has wandered by as many steps
w of variance W dt^2 as lie between, and ranges with it by a_j w_j, where the rates are a_1 u_1 + a_2 u_2.

From the window's centre to now the error grows with the odometry's noise and scale (``pushed``).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.observer_kernels import seen_from
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, cast_rays, range_gradient
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians

POSE = 3
_STEP = 1e-6  # [m, rad, m/s, rad/s] of a difference
_KEPT = 5  # steps for which derivatives are used
_REFUSED = 4.0  # deviations of a fit's residuals, beyond which a reading is left out: those of ``centre_fit``
_ROUNDING = 1e-9  # [m, rad] least deviation

Step = Callable[[Array, Array, Array, Array, Array, bool], tuple[Array, Array]]
"""z (l + 1,) and pose (3,) after a step from z (l + 1,) and a pose (3,), which replaces lost rays, with errors (l,) [m]
of ranges, (l,) [m/s] of their rates and (2,) of the input, by the observer's own feed-forward, or by the exact one if
the flag is True"""


class ObserverCovariance:
    """Second moments of the errors of z, of the pose, and of what they come from."""

    def __init__(self, model: RangeModel, weights: Array, period: float, *, reckoned: bool) -> None:
        """``weights`` (p + 1, 2 m + 1) are those of the fit, which is ``reckoned`` if it is to what readings are off
        from those of a robot that moves through the window as the odometry says.
        """
        l = len(model.angles)  # noqa: E741
        self._model, self._period, self._l = model, period, l
        seconds = period * (weights.shape[1] // 2)  # of a unit of the fit's time
        value, slope = float(np.square(weights[0]).sum()), float(np.square(weights[1]).sum()) / seconds**2
        omega = math.sqrt(slope / value)
        zeta = omega * period / (4.0 * value)
        flow: Array = expm(period * np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]]))
        self._flow, self._steady = flow, np.array([value, slope])
        self._wandering = reckoned * period**2 * _wandering(weights[:2]) / np.array([1.0, seconds**2])
        steady = np.diag(self._steady)
        self._new = steady - flow @ steady @ flow.T  # for readings of variance one
        c = self._c = l + 1 + POSE
        self._P = np.zeros((c + 2 * l + 1, c + 2 * l + 1))  # of e_z, e_x, (n, n') of each ray over its deviation, and b
        self._mean = np.zeros(c)
        self._D, self._d = np.zeros((c, c + 2 * l + 2)), np.zeros(c)
        self._age, self._seen = _KEPT, np.zeros(l, np.bool_)
        self._scale = np.ones(2 * l + 1)  # of (n, n') of each ray, and b
        self._largest = np.square([model.longest, model.longest, math.pi])
        self._disagreement = 0.0
        self.start(np.zeros((l + 1, POSE)), np.zeros((POSE, POSE)))

    def start(self, slopes: Array, P: Array) -> None:
        """Start with the covariance P (3, 3) of the pose and the derivatives (l + 1, 3) of z by it."""
        c, both = self._c, np.vstack((slopes, np.eye(POSE)))
        self._P[:] = 0.0
        self._P[:c, :c] = both @ P @ both.T
        self._P[c:-1, c:-1] = np.diag(np.tile(self._steady, self._l))
        self._P[-1, -1] = self._model.scale**2
        self._mean[:], self._age, self._disagreement = 0.0, _KEPT, 0.0

    def step(self, by: Step, z: Array, pose: Array, readings: Array, filled: Array, u: Array) -> None:
        """Take one step of the observer from z (l + 1,) and the ``pose`` (3,) with the fitted ``readings`` (2, l), NaN
        for a lost ray, and the input u (2,).

        ``filled`` (l,) is the share of the window's readings that there are: with k of N the variance of a value is
        N / k times as large, and that of a slope (N / k)^3. Without a slope the value is a single reading.
        """
        rho, seen = readings[0], np.isfinite(readings[0])
        if self._age >= _KEPT or (seen != self._seen).any():
            self._linearise(by, z, pose)
            self._age, self._seen = 0, seen
        self._age += 1
        fewer = np.where(np.isfinite(readings[1]), np.maximum(filled, 0.1) ** -1.5, 1.0 / math.sqrt(self._steady[0]))
        sigma = fewer * np.sqrt(self._variance(np.where(seen, rho, 0.0)))
        self._scale = np.append(np.repeat(sigma, 2), 1.0)
        self._P, self._mean = recursed(
            self._P, self._mean, self._D, self._d, self._flow, self._new, sigma, u, self._model.W
        )
        self._limit()

    def disagreement(self, wall: WallShape, pose: Array, readings: Array, u: Array) -> float:
        """The largest difference of fitted ranges and rates, ``readings`` (2, l), from those expected at the ``pose``
        (3,) under u (2,), over its standard deviation.

        It is that of the step before, unless derivatives are new.
        """
        if self._age != 1:
            return self._disagreement
        l, expected = self._l, ranges_and_rates(wall, self._model.angles, pose, u)  # noqa: E741
        T = np.zeros((2 * l, POSE + 2 * l + 1))
        for j in range(POSE):
            moved = pose.copy()
            moved[j] += _STEP
            T[:, j] = (expected - ranges_and_rates(wall, self._model.angles, moved, u)) / _STEP
        T[:l, POSE:-1:2], T[l:, POSE + 1 : -1 : 2] = np.eye(l), np.eye(l)
        T[l:, -1] = -expected[l:]
        r = readings[:2].ravel() - expected
        known = np.isfinite(r) & np.isfinite(T).all(axis=1)
        if not known.any():
            self._disagreement = 0.0
            return 0.0
        T, r = T[known], r[known]
        at = self._c - POSE
        scale = np.append(np.ones(POSE), self._scale)
        joint, m = self._P[at:, at:] * np.outer(scale, scale), T[:, :POSE] @ self._mean[at : self._c]
        along = [ranges_and_rates(wall, self._model.angles, pose, each)[l:] for each in np.eye(2)]  # a_j
        wandering = np.outer(self._wandering, np.square(along).T @ self._model.W).ravel()[known]
        variance = np.maximum(np.einsum("ij,jk,ik->i", T, joint, T), _ROUNDING**2) + np.square(m) + wandering
        self._disagreement = float((np.abs(r) / np.sqrt(variance)).max())
        return self._disagreement

    def _variance(self, rho: Array) -> Array:
        """Variances (l,) [m^2] of single readings, with the outliers that the fit does not leave out."""
        variance, longest, outliers = self._model.range_variance(rho), self._model.longest, self._model.outliers
        if outliers == 0.0:
            return variance
        limit = np.minimum(_REFUSED * np.sqrt(variance + outliers * longest**2 / 3.0), longest)
        more: Array = variance + outliers * np.minimum(2.0 * limit / longest, 1.0) * np.square(limit) / 3.0
        return more

    def _linearise(self, by: Step, z: Array, pose: Array) -> None:
        l, c, a = self._l, self._c, self._l + 1  # noqa: E741

        def after(errors: Array, exact: bool = False) -> Array:
            n, rates, du = errors[c : c + l], errors[c + l : -2], errors[-2:]
            found: Array = np.concatenate(by(z + errors[:a], pose + errors[a:c], n, rates, du, exact))
            return found

        nothing = np.zeros(c + 2 * l + 2)
        here = after(nothing)
        D = np.array([(after(_STEP * each) - here) / _STEP for each in np.eye(len(nothing))]).T
        d = here - after(nothing, exact=True)
        self._D[:], self._d[:] = np.where(np.isfinite(D), D, 0.0), np.where(np.isfinite(d), d, 0.0)

    def _limit(self) -> None:
        """Keep the pose within the wall: what is linearised far from the truth may grow without bounds."""
        c = self._c
        at = slice(c - POSE, c)
        share = float(((self._P.diagonal()[at] + np.square(self._mean[at])) / self._largest).max())
        if not math.isfinite(share):
            self._P[:c], self._P[:, :c], self._mean[:] = 0.0, 0.0, 0.0
            self._P[:c, :c] = np.diag(np.append(np.full(c - POSE, math.pi**2), self._largest))
        elif share > 1.0:
            scale = np.ones(len(self._P))
            scale[:c] = 1.0 / math.sqrt(share)
            self._P *= np.outer(scale, scale)
            self._mean *= scale[:c]

    def now(self, pose: Array, inputs: Array) -> Array:
        """Covariance (3, 3) of the ``pose`` (3,) at the centre once it is pushed forward by the ``inputs`` (k, 2)."""
        at = [*range(self._c - POSE, self._c), -1]
        P, m = self._P[np.ix_(at, at)], self._mean[self._c - POSE : self._c]
        P[:POSE, :POSE] += np.outer(m, m)
        after = pushed(P, pose, inputs, self._model.W, self._period)[:POSE, :POSE]
        covariance: Array = 0.5 * (after + after.T) + _ROUNDING**2 * np.eye(POSE)
        return covariance


def _wandering(weights: Array) -> Array:
    """Variances (k,) of sums with ``weights`` (k, 2 m + 1) of a walk of unit steps that is zero at the centre."""
    m = weights.shape[1] // 2
    ahead = np.cumsum(weights[:, :m:-1], axis=1)  # of all values that have a step, the outermost first
    behind = np.cumsum(weights[:, :m], axis=1)
    found: Array = np.square(ahead).sum(axis=1) + np.square(behind).sum(axis=1)
    return found


def slopes_of(wall: WallShape, alpha: Array, pose: Array, z: Array) -> Array:
    """Derivatives (l + 1, 3) of Psi at a ``pose`` (3,), whose z (l + 1,) is given, by differences; 0 where there is
    none.
    """
    columns = [(seen_from(wall, alpha, pose + _STEP * each, z) - z) / _STEP for each in np.eye(POSE)]
    slopes = np.array(columns).T
    found: Array = np.where(np.isfinite(slopes), slopes, 0.0)
    return found


@njit(cache=True, nogil=True)
def ranges_and_rates(wall: WallShape, alpha: Array, pose: Array, u: Array) -> Array:
    """Ranges [m] and range rates [m/s] (2 l,) of rays alpha (l,) at a ``pose`` (3,) under u (2,); NaN for none."""
    coefficients, polyline = wall
    rho, s = cast_rays(coefficients, polyline, pose, alpha)
    l = len(alpha)  # noqa: E741
    found = np.empty(2 * l)
    for i in range(l):
        by_x, by_y, by_phi = range_gradient(coefficients, s[i], rho[i], pose[2] + alpha[i])
        found[i] = rho[i]
        found[l + i] = u[0] * (by_x * math.cos(pose[2]) + by_y * math.sin(pose[2])) + u[1] * by_phi
    return found


@njit(cache=True, nogil=True)
def innovations(
    wall: WallShape,
    rays: tuple[Array, float, float],
    rho: Array,
    pose: Array,
    P: Array,
    u: tuple[Array, Array, float],
    dt: float,
    found: Array,
) -> None:
    """Write the innovations of ranges rho (l,) [m], NaN where lost, and their deviations into ``found`` (2, l) [m].

    They are predicted from a ``pose`` (3,) with covariance P (3, 3), dt [s] before, under a reading of the input (2,)
    with variances (2,) and the variance of its scale error; ``rays`` are alpha (l,), the relative and the absolute
    deviation of a range.
    """
    alpha, relative, absolute = rays
    value, W, scale = u
    F, G = integrate_jacobians(pose, value[0], value[1], dt)
    after = integrate(pose, value[0], value[1], dt)
    by_scale = G @ value
    moved = F @ P @ F.T
    for i in range(3):
        for j in range(3):
            moved[i, j] += G[i, 0] * W[0] * G[j, 0] + G[i, 1] * W[1] * G[j, 1] + by_scale[i] * scale * by_scale[j]
    coefficients, polyline = wall
    h, s = cast_rays(coefficients, polyline, after, alpha)
    H = np.empty(3)
    for i in range(len(alpha)):
        found[0, i] = found[1, i] = math.nan
        if math.isnan(rho[i]) or math.isnan(h[i]):
            continue
        H[0], H[1], H[2] = range_gradient(coefficients, s[i], h[i], after[2] + alpha[i])
        S = (relative * h[i]) ** 2 + absolute**2 + H @ moved @ H
        if math.isfinite(S):
            found[0, i], found[1, i] = rho[i] - h[i], math.sqrt(S)


@njit(cache=True, nogil=True)
def pushed(P: Array, pose: Array, inputs: Array, W: Array, dt: float) -> Array:
    """Covariance (4, 4) of the pose and of b after the ``inputs`` (k, 2), of variances W (2,), each held for dt [s]."""
    poses = np.empty((len(inputs) + 1, 3))
    poses[0] = pose
    for k in range(len(inputs)):
        poses[k + 1] = integrate(poses[k], inputs[k, 0], inputs[k, 1], dt)
    end = poses[-1]
    A, N = np.eye(4), np.zeros((4, 4))
    A[0, 2], A[1, 2] = pose[1] - end[1], end[0] - pose[0]
    g = np.empty((3, 2))
    for k in range(len(inputs)):
        _, G = integrate_jacobians(poses[k], inputs[k, 0], inputs[k, 1], dt)
        at = poses[k + 1]
        for j in range(2):  # what an error of the input does to the last pose
            g[0, j] = G[0, j] + (at[1] - end[1]) * G[2, j]
            g[1, j] = G[1, j] + (end[0] - at[0]) * G[2, j]
            g[2, j] = G[2, j]
            for i in range(3):
                A[i, 3] += g[i, j] * inputs[k, j]
                for m in range(3):
                    N[i, m] += g[i, j] * W[j] * g[m, j]
    return A @ P @ A.T + N


@njit(cache=True, nogil=True)
def recursed(
    P: Array, mean: Array, D: Array, d: Array, flow: Array, new: Array, sigma: Array, u: Array, W: Array
) -> tuple[Array, Array]:
    """Covariance P and ``mean`` (c,) one step later, by the derivatives D (c, c + 2 l + 2) of a step.

    ``flow`` (2, 2) and ``new`` (2, 2) are those of the errors of each ray, of deviation ``sigma`` (l,).
    """
    c, l, n = len(mean), len(sigma), len(P)  # noqa: E741
    A = np.eye(n)
    for i in range(l):
        at = c + 2 * i
        A[at : at + 2, at : at + 2] = flow
        for j in range(c):
            of_value, of_rate = D[j, c + i] * sigma[i], D[j, c + l + i] * sigma[i]
            A[j, at] = of_value * flow[0, 0] + of_rate * flow[1, 0]
            A[j, at + 1] = of_value * flow[0, 1] + of_rate * flow[1, 1]
    B = np.zeros((n, 2 * l))
    N = np.zeros((2 * l, 2 * l))
    for i in range(l):
        at = c + 2 * i
        B[at, 2 * i] = B[at + 1, 2 * i + 1] = 1.0
        N[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = new
        for j in range(c):
            B[j, 2 * i], B[j, 2 * i + 1] = D[j, c + i] * sigma[i], D[j, c + l + i] * sigma[i]
    after = np.zeros(c)
    for i in range(c):
        after[i] = d[i]
        for j in range(c):
            A[i, j] = D[i, j]
            after[i] += D[i, j] * mean[j]
        A[i, n - 1] = D[i, c + 2 * l] * u[0] + D[i, c + 2 * l + 1] * u[1]
    P = A @ P @ A.T + B @ N @ B.T
    for i in range(c):
        for j in range(c):
            for k in range(2):
                P[i, j] += D[i, c + 2 * l + k] * W[k] * D[j, c + 2 * l + k]
    return P, after
