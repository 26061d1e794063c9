"""A command for one period and the way to rest at the target behind it, compiled, with every change on a control
instant.

The velocity v_1 after the command u is changed into vertical flight at w, then to rest, at a_max; from there the way
leads up, across and down as in ``completion``. Every arc lasts a whole number of periods h: a change of the velocity
by D takes n = floor(|D| / (a_max h)) periods at a_max and one with what is left, so that where the vehicle stops is
continuous in u, and an input that is held for a period loses nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import OPTIMISED, Array, Integers
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.kernels import arc_clearance

CLIMBS = (0.0, 0.5, 1.0)
"""climb rates w as fractions of the horizontal speed: stopped level, or pulled up"""
_MOST_ARCS = 16
_LEVEL_MARGIN = 1.0  # [m] above the clearance, so that rounding cannot violate it in level flight
_ROUNDING = 1e-9  # [m/s, m/s^2] on a bound
_INSIDE = 1e-6  # [m] by which a step of the search aims beyond the bound
_STEP = 0.25  # [m/s^2] of the differences by which the gradient of a margin is taken
_BRAKING = 0.5  # share of a_max with which a vehicle that is too fast brakes at least
_ITERATIONS = 12  # of the projection on two balls
_STEPS = 4  # of the search along the gradient
_HALVINGS = 8  # of a segment
_MANOEUVRE, _CLIMB = int(FlightPhase.MANOEUVRE), int(FlightPhase.CLIMB)
_CRUISE, _DESCENT = int(FlightPhase.CRUISE), int(FlightPhase.DESCENT)


class Limits(NamedTuple):
    """Requirements of a certificate on a path, over ground that is raised by the tracking bound."""

    z: Array  # (rows, cols) [m]
    spacing: float  # [m]
    clearance_min: float  # [m] h_min
    border: float  # [m] that is kept from the edge of the map
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    cruise_level: float  # [m]
    period: float  # [s] h


@njit(cache=True, nogil=True)
def completed(
    limits: Limits, target: Array, t: float, x: Array, u: Array, climb: float
) -> tuple[Array, Array, Array, Integers]:
    """The path from x (6,) [m, m/s] at t [s] that holds u (3,) [m/s^2] for a period and ends at rest on the target.

    ``climb`` is w as a fraction of the horizontal speed. Returns the breakpoints (K + 1,) [s], states (K + 1, 6),
    inputs (K, 3) and phases (K,) of a plan; K = 0 if the vehicle stops off the map or too near its edge.
    """
    h, a_max = limits.period, limits.acceleration_max
    times, states = np.empty(_MOST_ARCS + 1), np.empty((_MOST_ARCS + 1, 6))
    inputs, phases = np.empty((_MOST_ARCS, 3)), np.empty(_MOST_ARCS, np.int64)
    times[0], states[0] = t, x
    k = _append(times, states, inputs, phases, 0, u, h, OPTIMISED)
    change = np.empty(3)
    w = climb * math.hypot(states[k, 3], states[k, 4])
    for end in (w, 0.0) if w > 0.0 else (0.0, 0.0):
        change[0], change[1], change[2] = -states[k, 3], -states[k, 4], end - states[k, 5]
        size = math.sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
        full, rest = _periods(size, a_max, h)
        if full > 0.0:
            k = _append(times, states, inputs, phases, k, change * (a_max / size), full, _MANOEUVRE)
        if rest > 0.0:
            k = _append(times, states, inputs, phases, k, change * (rest / (size * h)), h, _MANOEUVRE)
    states[k, 3:] = 0.0
    across = target[:2] - states[k, :2]
    distance = math.hypot(across[0], across[1])
    if distance > 0.0:
        line = np.array([across[0], across[1], 0.0])
        floor = np.array([states[k, 0], states[k, 1], 0.0])
        # The line is shortened so that rounding does not carry a point on the border off the map.
        highest = -arc_clearance(limits.z, limits.spacing, floor, line * (1.0 - 1e-12), np.zeros(3), 1.0)
        if not highest < np.inf:
            return times[:1], states[:1], inputs[:0], phases[:0]
        safe = highest + limits.clearance_min + _LEVEL_MARGIN
        level = max(max(states[k, 2], target[2]), max(safe, limits.cruise_level))
        up = np.array([0.0, 0.0, 1.0])
        k = _straight(times, states, inputs, phases, k, up, level - states[k, 2], limits, _CLIMB)
        k = _straight(times, states, inputs, phases, k, line / distance, distance, limits, _CRUISE)
    drop = states[k, 2] - target[2]
    phase = _DESCENT if drop > 0.0 else _CLIMB
    vertical = np.array([0.0, 0.0, -1.0 if drop > 0.0 else 1.0])
    k = _straight(times, states, inputs, phases, k, vertical, abs(drop), limits, phase)
    return times[: k + 1].copy(), states[: k + 1].copy(), inputs[:k].copy(), phases[:k].copy()


@njit(cache=True, nogil=True)
def margin_of(limits: Limits, x: Array, u: Array) -> tuple[float, float]:
    """Margin [m] of a command u (3,) [m/s^2] from x (6,) [m, m/s] until the vehicle has stopped, and the climb with it.

    The least clearance beyond h_min, or the room at the edge of the map beyond what is kept from it if that is
    negative; -inf beyond the bounds of speed and acceleration, and where it is too fast and does not brake. Of the
    climbs the first whose margin is not negative counts, else the best.
    """
    h = limits.period
    before = math.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    v = x[3:] + h * u
    after = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    asked = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    best, climb = -np.inf, 0.0
    # Written this way round, so that NaN is beyond them.
    if not (asked <= limits.acceleration_max + _ROUNDING and after <= _fastest(limits, before) + _ROUNDING):
        return best, climb
    p = x[:3] + h * x[3:] + 0.5 * h * h * u
    first = _arc_margin(limits, x[:3], x[3:], u, h)
    if first < 0.0:
        return first, climb
    across = math.hypot(v[0], v[1])
    change, here, speed = np.empty(3), np.empty(3), np.empty(3)
    for share in CLIMBS:
        if share > 0.0 and across == 0.0:
            break
        change[0], change[1], change[2] = -v[0], -v[1], share * across - v[2]
        here[:], speed[:] = p, v
        margin = first
        size = math.sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
        full, rest = _periods(size, limits.acceleration_max, h)
        for part in range(2):
            duration = full if part == 0 else h
            push = limits.acceleration_max if part == 0 else rest / h
            if duration == 0.0 or push == 0.0:
                continue
            a = change * (push / size)
            margin = min(margin, _arc_margin(limits, here, speed, a, duration))
            for i in range(3):
                here[i] += duration * speed[i] + 0.5 * duration * duration * a[i]
                speed[i] += duration * a[i]
        if margin > best:
            best, climb = margin, share
        if best >= 0.0:
            break
    return best, climb


@njit(cache=True, nogil=True)
def _fastest(limits: Limits, before: float) -> float:
    """Greatest speed [m/s] after a command; a vehicle that is too fast before it, after a gust, has to brake."""
    return max(limits.speed_max, before - _BRAKING * limits.acceleration_max * limits.period)


@njit(cache=True, nogil=True)
def nearest(limits: Limits, x: Array, proposed: Array, stored: Array, budget: int) -> Array:
    """Commands (n, 3) [m/s^2] with margins that are not negative near one that has none.

    In order: ``proposed`` (3,) within the bounds of speed and acceleration; steps along the gradient of the margin; the
    command ``stored`` (3,) of the plan that is flown, full braking, straight up; then the segment between the nearest
    of these and the first, halved. No more than ``budget`` are tried, and a greater budget tries the same first.
    """
    found = np.empty((budget, 3))
    before = math.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    allowed = _fastest(limits, before)
    first = _within(proposed, x[3:], allowed, limits)
    count = tried = 0
    best, least = first, np.inf
    u, gradient = first.copy(), np.empty(3)
    for step in range(_STEPS):
        for i in range(4):  # the command itself, then a difference along each axis
            if tried == budget:
                return found[:count]
            c = u.copy()
            if i > 0:
                c[i - 1] += _STEP
            margin = margin_of(limits, x, c)[0]
            tried += 1
            if i == 0:
                here = margin
            else:
                gradient[i - 1] = (margin - here) / _STEP
            if margin >= 0.0:
                found[count] = c
                count += 1
                distance = _distance(c, first)
                if distance < least:
                    best, least = c, distance
                if i == 0:
                    break
        if here >= 0.0:
            if step == 0:
                return found[:count]
            break
        square = gradient[0] ** 2 + gradient[1] ** 2 + gradient[2] ** 2
        if not (0.0 < square < np.inf):
            break
        u = _within(u + ((_INSIDE - here) / square) * gradient, x[3:], allowed, limits)
    for other in range(3):
        if tried == budget:
            return found[:count]
        if other == 0:
            c = _within(stored, x[3:], allowed, limits)
        elif other == 1:
            c = -x[3:] * (limits.acceleration_max / max(before, limits.acceleration_max * limits.period))
        else:
            c = _within(np.array([0.0, 0.0, limits.acceleration_max]), x[3:], allowed, limits)
        margin = margin_of(limits, x, c)[0]
        tried += 1
        if margin >= 0.0:
            found[count] = c
            count += 1
            distance = _distance(c, first)
            if distance < least:
                best, least = c, distance
    if count == 0:
        return found[:0]
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        if tried == budget:
            break
        share = 0.5 * (low + high)
        c = first + share * (best - first)
        margin = margin_of(limits, x, c)[0]
        tried += 1
        if margin >= 0.0:
            found[count] = c
            count += 1
            high = share
        else:
            low = share
    return found[:count]


@njit(cache=True, nogil=True)
def _distance(a: Array, b: Array) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True, nogil=True)
def _within(u: Array, v: Array, speed_max: float, limits: Limits) -> Array:
    """The nearest command to u (3,) with |u| <= a_max and |v + h u| <= ``speed_max`` (R. L. Dykstra)."""
    h = limits.period
    c, from_push, from_speed = u.copy(), np.zeros(3), np.zeros(3)
    for _ in range(_ITERATIONS):
        before = c + from_push
        size = math.sqrt(before[0] ** 2 + before[1] ** 2 + before[2] ** 2)
        within = before * min(1.0, limits.acceleration_max / size) if size > 0.0 else before
        from_push = before - within
        before = within + from_speed
        w = v + h * before
        size = math.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
        c = (w * (speed_max / size) - v) / h if size > speed_max else before
        from_speed = before - c
        size = math.sqrt(c[0] ** 2 + c[1] ** 2 + c[2] ** 2)
        if size <= limits.acceleration_max + 0.5 * _ROUNDING:
            break
    return c


@inner_njit(nogil=True)
def _periods(size: float, a_max: float, h: float) -> tuple[float, float]:
    """Duration [s] of a_max in a change of the velocity by ``size`` [m/s], and the rest [m/s] for one more period."""
    n = math.floor(size / (a_max * h))
    return n * h, max(size - n * a_max * h, 0.0)


@inner_njit(nogil=True)
def _arc_margin(limits: Limits, p: Array, v: Array, a: Array, duration: float) -> float:
    """Least clearance beyond h_min [m] of an arc, or its room at the edge of the map if that is negative."""
    room = np.inf
    for axis in range(2):
        last = (limits.z.shape[1 - axis] - 1) * limits.spacing - limits.border
        vertex = min(max(-v[axis] / a[axis], 0.0), duration) if a[axis] != 0.0 else duration
        for s in (0.0, vertex, duration):
            met = p[axis] + s * v[axis] + 0.5 * s * s * a[axis]
            room = min(room, min(met - limits.border, last - met))
    if room < 0.0:
        return room
    return arc_clearance(limits.z, limits.spacing, p, v, a, duration) - limits.clearance_min


@njit(cache=True, nogil=True)
def _append(t: Array, x: Array, u: Array, phase: Integers, k: int, a: Array, duration: float, number: int) -> int:
    for i in range(3):
        x[k + 1, i] = x[k, i] + duration * x[k, 3 + i] + 0.5 * duration * duration * a[i]
        x[k + 1, 3 + i] = x[k, 3 + i] + duration * a[i]
    t[k + 1], u[k], phase[k] = t[k] + duration, a, number
    return k + 1


@njit(cache=True, nogil=True)
def _straight(
    t: Array,
    x: Array,
    u: Array,
    phase: Integers,
    k: int,
    direction: Array,
    distance: float,
    limits: Limits,
    number: int,
) -> int:
    """Append a line from rest to rest along ``direction`` (3,), in whole periods."""
    if distance <= 0.0:
        return k
    h = limits.period
    peak = min(limits.speed_max, math.sqrt(distance * limits.acceleration_max))
    ramp = math.ceil(peak / (limits.acceleration_max * h))
    level = math.ceil((distance - peak * peak / limits.acceleration_max) / (peak * h) - _ROUNDING)
    a = direction * (distance / (ramp * (ramp + level) * h * h))
    k = _append(t, x, u, phase, k, a, ramp * h, number)
    if level > 0:
        k = _append(t, x, u, phase, k, np.zeros(3), level * h, number)
    k = _append(t, x, u, phase, k, -a, ramp * h, number)
    x[k, 3:] = 0.0
    return k
