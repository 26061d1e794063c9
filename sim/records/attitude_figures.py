"""Errors of attitudes against a reference, apart: of the inclination, and of the heading.

The error of an attitude q^ against q is e = q^ q^-1 = (w, x, y, z) in the axes of the world, z up. A turn by psi about
the vertical and a turn by theta about an axis in the horizontal plane make it (D. Laidig, T. Seel, VQF, Information
Fusion 91, 2023),

    psi = 2 atan2(z, w),      theta = 2 arccos sqrt(w^2 + z^2),

the errors of heading and inclination. Without a magnetometer the heading is that of the start and drifts: its error is
relative to that at the first time at which the estimate is used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from mathnavi.interfaces.signal_names import AXES, name_and_unit
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped

_CHANCE = 1e-3  # of an error that counts as wrong


def is_quaternion(names: Sequence[str]) -> bool:
    """True for the names "NAME w", "NAME x", "NAME y", "NAME z", without a unit, of one quaternion."""
    parts = [name_and_unit(each) for each in names]
    stems = {name.rpartition(" ")[0] for name, _ in parts}
    axes = tuple(name.rpartition(" ")[2] for name, _ in parts)
    return len(stems) == 1 and axes == AXES[4] and not any(unit for _, unit in parts)


def continued(q: Array) -> Array:
    """Unit quaternions (n, 4), each with the sign in which it is the nearer to the one before."""
    signs = np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    found: Array = q * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
    return found


def attitude_errors(q: Array, truth: Array) -> tuple[Array, Array]:
    """Errors of the inclination (n, 2), turns [rad] about the axes of the world, and of the heading (n,) [rad].

    ``q`` and ``truth`` are (n, 4), scalar first.
    """
    w, x, y, z = q.T
    a, b, c, d = truth.T * np.array([[1.0], [-1.0], [-1.0], [-1.0]])
    e = [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b]
    e.append(w * d + x * c - y * b + z * a)
    heading = 2.0 * np.arctan2(e[3], e[0])
    cos, sin = np.cos(0.5 * heading), np.sin(0.5 * heading)
    aside = np.stack([e[1] * cos - e[2] * sin, e[2] * cos + e[1] * sin], axis=-1)  # e turned back about the vertical
    length = np.hypot(*aside.T)
    angle = 2.0 * np.arctan2(length, np.hypot(e[0], e[3]))
    inclination = aside * np.where(length > 0.0, angle / np.where(length > 0.0, length, 1.0), 2.0)[:, None]
    return inclination, wrapped(heading)


def inclination_covariance(q: Array, covariance: Array) -> Array:
    """Covariances (n, 2, 2) [rad^2] of the turns about the horizontal axes of the world, of those (n, 4, 4) of q
    (n, 4).
    """
    w, x, y, z = q.T
    L = 2.0 * np.stack([np.stack([-x, w, -z, y], axis=-1), np.stack([-y, z, w, -x], axis=-1)], axis=1)
    found: Array = L @ covariance @ L.transpose(0, 2, 1)
    return found


def attitude_figures(q: Array, covariance: Array, usable: NDArray[np.bool_], truth: Array) -> dict[str, float]:
    """Figures by the names of a summary of attitudes (n, 4) with covariances (n, 4, 4), against the truth (n, 4).

    Times at which the truth is NaN are left out. ``inclination_rms_deg``, ``heading_drift_rms_deg`` and
    ``attitude_rms_deg``, of the whole error with that drift, are root mean squares over the times at which the estimate
    may be used; ``nees_mean`` is of the inclination there, over its 2 components, ``usable_share`` of all times, and
    ``wrong_share`` those at which it was used and its inclination off by more than its covariance allows in all but one
    of a thousand cases.
    """
    known = np.isfinite(truth).all(axis=1)
    q, covariance, usable, truth = q[known], covariance[known], usable[known], truth[known]
    if not usable.any():
        return {"usable_share": 0.0, "wrong_share": 0.0}
    inclination, heading = attitude_errors(q, truth)
    drift = wrapped(heading - heading[int(np.argmax(usable))])
    tilt = np.hypot(*inclination.T)
    whole = 2.0 * np.arccos(np.clip(np.cos(0.5 * tilt) * np.cos(0.5 * drift), -1.0, 1.0))
    solved = np.linalg.solve(inclination_covariance(q, covariance), inclination[:, :, None])[:, :, 0]
    nees = (inclination * solved).sum(axis=1)
    return {
        "inclination_rms_deg": _rms_deg(tilt[usable]),
        "heading_drift_rms_deg": _rms_deg(drift[usable]),
        "attitude_rms_deg": _rms_deg(whole[usable]),
        "nees_mean": float(nees[usable].mean()) / 2.0,
        "usable_share": float(usable.mean()),
        "wrong_share": float((usable & (nees > chdtri(2, _CHANCE))).mean()),
    }


def _rms_deg(angles: Array) -> float:
    return math.degrees(float(np.sqrt(np.mean(np.square(angles)))))
