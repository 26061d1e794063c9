"""Compiled kernels that fly point masses for a number of control steps under held accelerations, one mission a row.

Over a control step h an acceleration a is held, gusts included, so that the arc is exact,

    p := p + v h + a h^2 / 2,        v := v + a h,

and equal to MuJoCo's Runge-Kutta steps of order 4 up to rounding, as long as nothing touches. A row whose hull
may touch within its next control step stops before it (``NEAR``): MuJoCo makes that step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.kernels import height_at

Integers = NDArray[np.int64]

FLYING, NEAR, ARRIVED, OFF_MAP, CRASHED, LATE = range(6)
"""states of a row"""


class Ground(NamedTuple):
    """Terrain below the vehicles."""

    z: Array  # (rows, columns) [m] heights at the nodes
    spacing: float  # [m] between nodes
    reach: float  # [m] from a vehicle's centre to its hull
    steepest: float  # greatest slope


class Rules(NamedTuple):
    """Length of a control step and limits of a mission."""

    h: float  # [s] length of a control step
    radius: float  # [m] around a target, within which a vehicle has arrived
    limits: tuple[float, float]  # (h_min [m], v_max [m/s])


class Rows(NamedTuple):
    """Episodes, one in each row, in arrays that are advanced in place."""

    x: Array  # (n, 6) [m, m/s] states
    targets: Array  # (n, 3) [m]
    last: Integers  # (n,) control steps of a whole episode
    done: Integers  # (n,) those made so far
    made: Integers  # (n,) those of this hold
    violated: Integers  # (n,) those of this hold at whose end a limit was not kept
    states: Integers  # (n,) FLYING, or how the episode has ended


@njit(cache=True, nogil=True)
def fly(ground: Ground, rules: Rules, rows: Rows, u: Array, gusts: Array) -> None:
    """Advance the rows that are ``FLYING`` until they have made as many control steps as ``gusts`` has, or end.

    u (n, 3) [m/s^2] are the accelerations held, gusts (n, steps, 3) [m/s^2].
    """
    z, spacing, reach, steepest = ground
    h, radius, limits = rules
    x, targets, last, done, made, violated, states = rows
    width, depth = (z.shape[1] - 1) * spacing, (z.shape[0] - 1) * spacing
    touch = reach * math.sqrt(1.0 + steepest * steepest)
    a = np.empty(3)
    for i in range(x.shape[0]):
        while states[i] == FLYING and made[i] < gusts.shape[1]:
            speed, strength = 0.0, 0.0
            for axis in range(3):
                a[axis] = u[i, axis] + gusts[i, made[i], axis]
                speed += x[i, 3 + axis] ** 2
                strength += a[axis] ** 2
            farthest = (math.sqrt(speed) + math.sqrt(strength) * h) * h
            clearance = x[i, 2] - height_at(z, spacing, x[i, 0], x[i, 1])
            if clearance <= touch + (1.0 + steepest) * farthest:
                states[i] = NEAR
                break
            for axis in range(3):
                x[i, axis] += h * x[i, 3 + axis] + 0.5 * h * h * a[axis]
                x[i, 3 + axis] += h * a[axis]
            made[i] += 1
            done[i] += 1
            violated[i] += is_violated(z, spacing, x[i], limits)
            states[i] = state_after(width, depth, x[i], targets[i], radius, done[i], last[i])


@njit(cache=True, nogil=True)
def is_violated(z: Array, spacing: float, x: Array, limits: tuple[float, float]) -> int:
    """Return 1 for a state x (6,) less than h_min [m] above the ground or faster than v_max [m/s], 0 for any other."""
    speed = math.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    return 0 if x[2] - height_at(z, spacing, x[0], x[1]) >= limits[0] and speed <= limits[1] else 1


@njit(cache=True, nogil=True)
def state_after(width: float, depth: float, x: Array, target: Array, radius: float, done: int, last: int) -> int:
    """Return the state of a row that has touched nothing, for x (6,) after ``done`` control steps."""
    if not (0.0 <= x[0] <= width and 0.0 <= x[1] <= depth):
        return OFF_MAP
    distance = math.sqrt((x[0] - target[0]) ** 2 + (x[1] - target[1]) ** 2 + (x[2] - target[2]) ** 2)
    if distance <= radius:
        return ARRIVED
    return LATE if done >= last else FLYING


@njit(cache=True, nogil=True)
def gusts_on(
    now: Array, begun: NDArray[np.bool_], fresh: Array, keep: float, stir: float, rms: float, limit: float
) -> Array:
    """Return gusts (n, steps, 3) of a first-order Gauss-Markov process, clipped to the length ``limit`` [m/s^2].

    ``now`` (n, 3) is the state of the process, which is changed, and ``begun`` (n,) is True for rows in which it runs;
    ``fresh`` (n, steps, 3) is standard normal.
    """
    out = np.empty_like(fresh)
    for i in range(fresh.shape[0]):
        for k in range(fresh.shape[1]):
            length = 0.0
            for axis in range(3):
                if begun[i]:
                    now[i, axis] = keep * now[i, axis] + stir * fresh[i, k, axis]
                else:
                    now[i, axis] = rms * fresh[i, k, axis]
                length += now[i, axis] ** 2
            begun[i] = True
            length = math.sqrt(length)
            share = min(1.0, limit / length) if length > 0.0 else 0.0
            for axis in range(3):
                out[i, k, axis] = share * now[i, axis]
    return out
