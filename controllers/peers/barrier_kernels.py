"""The barrier filter, compiled: barriers over the ground, the filtered input, and its closed loop over a horizon."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.controllers.flight.spline import length_to_go, surface, surface_curvature
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array

_HALVINGS = 40  # of the multiplier of |u| <= a_max


@njit(cache=True, nogil=True)
def project(u: Array, g: Array, b: float, q: Array, c: float) -> Array:
    """Nearest point (3,) [m/s^2] to u (3,) with g'u >= b and q'u >= c, of which neither contradicts the other."""
    over_g, over_q = b - float(g @ u), c - float(q @ u)
    if over_g <= 0.0 and over_q <= 0.0:
        return u.copy()
    gg, qq, gq = float(g @ g), float(q @ q), float(g @ q)
    if over_g > 0.0:
        only: Array = u + (over_g / gg) * g
        if q @ only >= c:
            return only
    if over_q > 0.0 and qq > 0.0:
        only = u + (over_q / qq) * q
        if g @ only >= b:
            return only
    determinant = max(gg * qq - gq * gq, 1e-9 * gg * max(qq, 1.0))
    first = (qq * over_g - gq * over_q) / determinant
    second = (gg * over_q - gq * over_g) / determinant
    corner: Array = u + first * g + second * q
    return corner


@njit(cache=True, nogil=True)
def filtered(nominal: Array, g: Array, b: float, q: Array, c: float, bound: float) -> Array:
    """argmin |u - nominal|^2 subject to g'u >= b, q'u >= c, |u| <= bound; the nearest input (3,) if infeasible.

    With the multiplier m of the last row u is the projection of nominal / (1 + m) onto the other two, and |u| falls
    with m. Where the rows contradict each other g'u is as large as the bound allows, and then q'u.
    """
    least = project(np.zeros(3), g, b, q, c)
    if not least @ least <= bound * bound:
        u = (bound / math.sqrt(g @ g)) * g
        over = c - q @ u
        if over > 0.0:
            u = u + (over / (q @ q)) * q
        size = math.sqrt(u @ u)
        return u * min(1.0, bound / size)
    u = project(nominal, g, b, q, c)
    if u @ u <= bound * bound:
        return u
    low, high = 0.0, 1.0  # of m / (1 + m)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        u = project((1.0 - middle) * nominal, g, b, q, c)
        if u @ u <= bound * bound:
            high = middle
        else:
            low = middle
    return project((1.0 - high) * nominal, g, b, q, c)


class BarrierShape(NamedTuple):
    """The two barriers, over the ground and around the target."""

    cover: Array  # spline coefficients of a smooth surface above the ground [m]
    spacing: float  # [m] of its nodes
    clearance: float  # [m] that is kept above it
    funnel: Array  # (5,) centre x, y, level z [m], slope, and rounding [m] of the one around the target


class SplineCost(NamedTuple):
    """The length to go as splines, see ``mathnavi.controllers.flight.cost_to_go.FactoredCost``."""

    ground: Array
    ratio: Array
    scales: Array  # (8,)


class BarrierLaw(NamedTuple):
    """Parameters of the filtered law."""

    speed: float  # [m/s] that is aimed at
    approach: float  # share of the deceleration by which the target is approached
    gain: float  # [1/s] of the velocity error
    decay: float  # [1/s] of the barriers
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    near: float  # [m] from the target, where it ends


@njit(cache=True, nogil=True)
def barrier(shape: BarrierShape, p: Array, v: Array) -> tuple[float, float, Array, float]:
    """Larger of the two barriers at p (3,) [m], v (3,) [m/s].

    Returns h [m], dh/dt [m/s], the gradient (3,) of h, and v'(Hessian of h)v [m/s^2].
    """
    cover, spacing, clearance, funnel = shape
    e, e_v, e_w = surface(cover, p[1] / spacing, p[0] / spacing)
    e_vv, e_vw, e_ww = surface_curvature(cover, p[1] / spacing, p[0] / spacing)
    h = float(p[2] - e - clearance)
    gradient = np.array([-e_w / spacing, -e_v / spacing, 1.0])
    second_derivative = float(
        -(e_ww * v[0] * v[0] + 2.0 * e_vw * v[0] * v[1] + e_vv * v[1] * v[1]) / (spacing * spacing)
    )
    x, y = p[0] - funnel[0], p[1] - funnel[1]
    r = math.sqrt(x * x + y * y + funnel[4] * funnel[4])
    around = float(p[2] - funnel[2] - funnel[3] * (r - funnel[4]))
    if around > h:
        h = around
        gradient = np.array([-funnel[3] * x / r, -funnel[3] * y / r, 1.0])
        along = (x * v[0] + y * v[1]) / r
        second_derivative = float(-funnel[3] * (v[0] * v[0] + v[1] * v[1] - along * along) / r)
    return h, float(gradient @ v), gradient, second_derivative


@njit(cache=True, nogil=True)
def closed_loop(
    start: Array, shape: BarrierShape, cost: SplineCost, law: BarrierLaw, step: float, steps: int
) -> tuple[Array, Array]:
    """States (k + 1, 6) and inputs (k, 3) of the filtered law from a state (6,), every ``step`` [s], k <= ``steps``.

    It ends early within ``law.near`` [m] of the target.
    """
    ground, ratio, scales = cost
    speed, approach, gain, decay, speed_max, bound, near = law
    x, u = np.empty((steps + 1, 6)), np.empty((steps, 3))
    x[0] = start
    gradient, hessian = np.empty(3), np.empty((3, 3))
    count = 0
    while count < steps:
        p, v = x[count, :3], x[count, 3:]
        to_go = math.sqrt((p[0] - scales[5]) ** 2 + (p[1] - scales[6]) ** 2 + (p[2] - scales[7]) ** 2)
        if to_go <= near:
            break
        length_to_go(ground, ratio, scales, p[0], p[1], p[2], gradient, hessian)
        size = max(math.sqrt(gradient @ gradient), 1e-9)
        wanted = -min(speed, math.sqrt(2.0 * approach * bound * to_go)) / size * gradient
        nominal = gain * (wanted - v)
        pull = math.sqrt(nominal @ nominal)
        if pull > bound:
            nominal *= bound / pull
        h, rate, slope, second_derivative = barrier(shape, p, v)
        b = -second_derivative - 2.0 * decay * rate - decay * decay * h
        c = -0.5 * decay * (speed_max * speed_max - float(v @ v))
        a = filtered(nominal, slope, b, -v, c, bound)
        u[count] = a
        x[count + 1, :3] = p + step * v + 0.5 * step * step * a
        x[count + 1, 3:] = v + step * a
        count += 1
    return x[: count + 1].copy(), u[:count].copy()
