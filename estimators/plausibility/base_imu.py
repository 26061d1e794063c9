"""Readings of the IMU on a mechanism's base while a foot stands: gravity is the greatest part of its specific force.

The accelerometer's length shows its unit. Its direction shows its sign, at the start, where the attitude is stated; and
over half a second, in which the direction turns as the gyro says, the unit of the gyro.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mathnavi.estimators.plausibility.units import DEGREES_PER_SECOND, GRAVITIES, MILLIGRAVITIES, fit_only
from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.floating_base import ATTITUDE, FloatingBase
from mathnavi.models.quaternion import rotation

_FEWEST = 20  # readings while a foot stands
_LIKE = 1.4  # ratio of the accelerometer's median length to gravity, at most
_OPPOSITE = -0.7  # cosine of the angle between the first readings and gravity
_DURATION, _WINDOWS, _MEAN = 0.5, 12, 0.1  # [s] of a window, number of windows, [s] over which directions are averaged
_TURNED, _WORSE = 0.3, 4.0  # [rad] that the gyro may be wrong over a window, and times what it is in deg/s

_GYRO, _ACCELEROMETER = "columns 0, 1, 2, the gyro", "columns 3, 4, 5, the accelerometer"


def misread(base: FloatingBase, start: Array, t: Array, imu: Array, feet: Array) -> str:
    """Return the only other way in which the readings ``imu`` (n, 6) at t (n,) [s] fit gravity while any of the
    ``feet`` (n, k) stands, and the position (nq,) at the start; "" if they fit unchanged, or not at all. NaN without a
    reading.
    """
    rows = np.flatnonzero(np.isfinite(imu).all(axis=1) & _stands(feet))
    gravity = float(np.linalg.norm(base.gravity))
    if len(rows) < _FEWEST or not gravity:
        return ""
    t, imu = t[rows], imu[rows]
    length = float(np.median(np.linalg.norm(imu[:, 3:], axis=1)))
    for unit in (GRAVITIES, MILLIGRAVITIES):
        if not _alike(length, gravity) and _alike(length * unit.factor, gravity):
            return fit_only("imu", "gravity", [(unit.name, _ACCELEROMETER, unit.allowed)])
    up = rotation(start[ATTITUDE]).T @ (-base.gravity / gravity)
    first = base.mounting @ imu[t <= t[0] + _MEAN, 3:].mean(axis=0)
    if float(first @ up) < _OPPOSITE * float(np.linalg.norm(first)):
        sign = ("with the other sign", _ACCELEROMETER, "gravity up at rest: multiply by -1")
        return fit_only("imu", "gravity at the start", [sign])
    errors = np.array(list(_errors(t, imu)))
    if len(errors):
        as_is, in_degrees = np.median(errors, axis=0)
        if as_is > max(_TURNED, _WORSE * in_degrees):
            unit = DEGREES_PER_SECOND
            return fit_only("imu", "the direction of gravity", [(unit.name, _GYRO, unit.allowed)])
    return ""


def _stands(feet: Array) -> NDArray[np.bool_]:
    """Return True (n,) from a reading of the switches with a foot that stands to the next."""
    known = ~np.isnan(feet).any(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(feet)), -1))
    stands: NDArray[np.bool_] = (last >= 0) & (np.nan_to_num(feet)[last] > 0.5).any(axis=1)
    return stands


def _alike(length: float, gravity: float) -> bool:
    return gravity / _LIKE <= length <= gravity * _LIKE


def _errors(t: Array, imu: Array) -> Iterator[tuple[float, float]]:
    """Angles [rad] between the accelerometer's direction at the end of windows and that by the gyro, read in rad/s and
    in deg/s.
    """
    starts = np.flatnonzero(t + _DURATION + _MEAN <= t[-1])
    for k in starts[np.unique(np.linspace(0, len(starts) - 1, _WINDOWS).astype(np.intp))] if len(starts) else ():
        ends = np.searchsorted(t, t[k] + np.array([_MEAN, _DURATION, _DURATION + _MEAN]))
        within = slice((k + int(ends[0])) // 2, int(ends[1] + ends[2]) // 2)
        dt = np.diff(t[within], prepend=t[within.start])[:, None]
        before, after = imu[k : ends[0], 3:].mean(axis=0), imu[ends[1] : ends[2], 3:].mean(axis=0)
        if np.ptp(t[k : ends[2]]) > 2.0 * _DURATION or not (before.any() and after.any()):
            continue
        angles = []
        for factor in (1.0, DEGREES_PER_SECOND.factor):
            turned = products(Rotation.from_rotvec(imu[within, :3] * dt * factor).as_matrix())[-1]
            expected = turned.T @ before
            cosine = expected @ after / (np.linalg.norm(expected) * np.linalg.norm(after))
            angles.append(float(np.arccos(np.clip(cosine, -1.0, 1.0))))
        yield angles[0], angles[1]


def products(turns: Array) -> Array:
    """Products (k, 3, 3) of the first 1, 2, ..., k rotations, in a number of steps that grows with log k."""
    shift = 1
    while shift < len(turns):
        turns = np.concatenate([turns[:shift], turns[:-shift] @ turns[shift:]])
        shift *= 2
    return turns
