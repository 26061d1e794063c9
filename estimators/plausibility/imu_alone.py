"""The readings of an inertial measurement unit alone: their units by gravity, and by how gravity turns.

The specific force f of a device that stays about a place is gravity in the mean, and turns against the device:

    f' = f x omega,

but for the change of its acceleration. The slope of f', over ``_SPAN``, by the mean of f x omega there is about one,
and the factor by which the gyro has to be multiplied otherwise. Where the device hardly turns, or where its
acceleration drowns gravity, nothing is said. Nor is a sign: a hand swings a device on an arc, where the acceleration
goes with the turn and is the larger, and of three recorded trials of five the slope was -1.7 to -2.8.
"""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.plausibility.units import DEGREES_PER_SECOND, GRAVITIES, MILLIGRAVITIES, Unit, fit_only
from mathnavi.interfaces.signals import Array

_SPAN = 0.1  # [s]
_CORRELATED = 0.4  # correlation of f' and f x omega, from which on the slope is believed
_FEWEST = 50  # spans


def misread(t: Array, imu: Array, gravity: float) -> str:
    """Say in which unit alone readings ``imu`` (n, 6) at t (n,) [s] fit a ``gravity`` [m/s^2]; "" if they fit as they
    are, or not at all.
    """
    known = np.isfinite(imu).all(axis=1)
    if not known.any():
        return ""
    times, rates, forces = t[known], imu[known, :3], imu[known, 3:]
    share = float(np.median(np.linalg.norm(forces, axis=1))) / gravity
    if not _is_about_one(share):
        unit = next((unit for unit in (GRAVITIES, MILLIGRAVITIES) if _is_about_one(share * unit.factor)), None)
        return "" if unit is None else _said("gravity", unit, "columns 3, 4, 5, the accelerometer")
    slope = _slope(times, rates, forces)
    if slope is None or not _is_about_one(slope / DEGREES_PER_SECOND.factor):
        return ""
    return _said("the turning of gravity", DEGREES_PER_SECOND, "columns 0, 1, 2, the gyro")


def _said(what: str, unit: Unit, columns: str) -> str:
    return fit_only("imu", what, ((unit.name, columns, unit.allowed),))


def _slope(t: Array, rates: Array, forces: Array) -> float | None:
    """Slope of f' by f x omega; None where these are too few, or too little alike."""
    if len(t) < 3 or not np.median(np.diff(t)) > 0.0:
        return None
    h = float(np.median(np.diff(t)))
    m = max(1, round(_SPAN / h))
    count = len(t) // m
    if count <= _FEWEST:
        return None

    def means(values: Array) -> Array:
        found: Array = values[: count * m].reshape(count, m, 3).mean(axis=1)
        return found

    turned = np.diff(means(forces), axis=0) / (m * h)
    cross = means(np.cross(forces, rates))
    expected = 0.5 * (cross[1:] + cross[:-1])
    square = float((expected * expected).sum()), float((turned * turned).sum())
    product = float((expected * turned).sum())
    if min(square) <= 0.0 or abs(product) < _CORRELATED * np.sqrt(square[0] * square[1]):
        return None
    return product / square[0]


def _is_about_one(share: float) -> bool:
    return 0.5 < share < 2.0
