"""Parameters of the joints of a mechanism from its motion and the inputs of its motors, by linear least squares.

At the positions q, velocities v and accelerations a of a motion, the motor of joint j moves what the links need, the
inertia of its rotor, and its friction:

    k_j u_j + o_j  =  tau_j(q, v, a) + J_j a_j + d_j v_j + f_j sign(v_j),

u being a current or a torque, tau the torque by the inertial parameters of the model, k the gain [N m per unit of u]
and o an offset. What is read with noise is u, so that it is the left side of the regression,

    u_j = (tau_j + J_j a_j + d_j v_j + f_j sign(v_j) - o_j) / k_j,

and the noise of u does not bias k. A gain that is known, as that of an input that is a torque, is held. q, v, a and u
come from the same local polynomials and have lost the same. Samples in whose window a joint hardly moves or turns
around say nothing of its friction, which may have any value up to f there, and are left out.

**Bounds.** J, d and f are not negative. A parameter that least squares would make negative is held at zero and the
others are fitted again.

**A gain that the motion does not show**, because its interval holds zero, can often be told from the inertia of the
rotor that the file has: J_j is held there. Where this does not help either, the gain has to be given.

**Time offset.** The inputs may be stamped later or earlier than the positions. The offset is the shift of the inputs
for which the sum of the squared residuals, each joint's over its variance, is least; its interval is that in which the
sum rises by what chance does, for as many independent samples as the correlation of the residuals leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.identification.least_squares import CONFIDENCE, Fit, correlated_for, fit
from mathnavi.estimators.identification.local_polynomials import smooth
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.signals import Array

NAMES = ("gain", "armature", "damping", "friction", "offset")
"""names of the parameters of a joint: k, J, d, f and o"""
GAIN, ARMATURE, DAMPING, FRICTION, OFFSET = range(5)
_SHIFTS = 41  # that are tried
_FEWEST = 50  # samples of a joint that moves
_TINY = 1e-300


class SmoothedMotion(NamedTuple):
    """Smoothed motion of one log at n stamps, and what the links need for it."""

    t: Array  # (n,) [s]
    q: Array  # (n, nv)
    v: Array  # (n, nv)
    a: Array  # (n, nv)
    u: Array  # (n, nv)
    least: Array  # (n, nv) least speed within the window about the stamp; 0 where the joint turns around there
    torque: Array  # (n, nv) by the inertial parameters of the model

    def part(self, rows: slice) -> SmoothedMotion:
        """Return some of the stamps."""
        return SmoothedMotion(*(each[rows] for each in self))


@dataclass(frozen=True)
class JointFit:
    """Parameters of one joint."""

    theta: Array  # (5,) k, J, d, f, o
    deviation: Array  # (5,) standard deviations; NaN of what was held
    held: tuple[str, ...]  # what was not fitted, and why, in words
    singular_values: Array  # of the columns that were fitted
    unseen: tuple[str, ...]  # combinations that the motion does not excite, in words

    @property
    def interval(self) -> Array:
        """Bounds (2, 5) of the intervals of 95 %; those of what was held are its value."""
        half = CONFIDENCE * np.nan_to_num(self.deviation)
        return np.stack([self.theta - half, self.theta + half])


def regressor(motion: SmoothedMotion, j: int) -> Array:
    """Columns (n, 5) that k, J, d, f and o multiply once the equation is divided by k."""
    v = motion.v[:, j]
    return np.column_stack([motion.torque[:, j], motion.a[:, j], v, np.sign(v), -np.ones(len(v))])


def predicted(motion: SmoothedMotion, j: int, theta: Array) -> Array:
    """Input (n,) that moves joint j as it moved, by its parameters (5,)."""
    k = theta[GAIN]
    return np.asarray(regressor(motion, j) @ np.concatenate([[1.0], theta[1:]]) / k, dtype=np.float64)


def moving(motion: SmoothedMotion, j: int, slowest: float) -> NDArray[np.intp]:
    """Places of the stamps about which joint j moves on, faster than ``slowest`` [rad/s, m/s]."""
    return np.flatnonzero(motion.least[:, j] > slowest)


def fit_joint(
    motion: SmoothedMotion, j: int, name: str, slowest: float, gain: float | None, armature: float
) -> JointFit:
    """Fit the parameters of joint j.

    Args:
        motion: the motion.
        j: joint.
        name: its name, for messages.
        slowest: speed [rad/s, m/s] below which a sample says nothing of its friction.
        gain: k [N m per unit] if it is known.
        armature: J [kg m^2, kg] of the model, which is held where nothing else shows the gain.

    Raises:
        LogError: for a joint that hardly moves, and where the gain is neither given nor shown by the motion.
    """
    rows = moving(motion, j, slowest)
    if len(rows) < _FEWEST:
        raise LogError(
            f"joint {name} moves faster than {slowest:g} rad/s in {len(rows)} samples; allowed: {_FEWEST} or more, "
            "in a log in which every joint moves"
        )
    A, u = regressor(motion, j)[rows], motion.u[rows, j]
    if gain is not None:
        return _known_gain(gain, A, u)
    if _shown(whole := fit(A, u)):
        return _named(*_divided(_bounded(A, u, divided=True)), whole, NAMES)
    if armature > 0.0:
        B = np.column_stack([A[:, GAIN] + armature * A[:, ARMATURE], A[:, DAMPING:]])
        if _shown(whole := fit(B, u)):
            theta, deviation, free = _divided(_bounded(B, u, divided=True))
            names = [each for each in NAMES if each != NAMES[ARMATURE]]
            own = _named(theta, deviation, free, whole, names)
            return JointFit(
                np.insert(theta, ARMATURE, armature),
                np.insert(own.deviation, ARMATURE, np.nan),
                (f"armature held at {armature:g} of the model, to tell the gain", *own.held),
                own.singular_values,
                own.unseen,
            )
    raise LogError(
        f"the motion does not show the gain of joint {name}: its links need a torque of "
        f"{motion.torque[rows, j].std():.3g} N m only; allowed: gains=, or a motion with larger accelerations"
    )


def _known_gain(gain: float, A: Array, u: Array) -> JointFit:
    B, torque = A[:, 1:], gain * u - A[:, GAIN]
    found, free = _bounded(B, torque, divided=False)
    own = _named(found.theta, found.deviation, free, fit(B, torque), NAMES[1:])
    return JointFit(
        np.insert(own.theta, GAIN, gain),
        np.insert(own.deviation, GAIN, np.nan),
        ("gain given", *own.held),
        own.singular_values,
        own.unseen,
    )


def _shown(found: Fit) -> bool:
    """True if the interval of the first parameter does not hold zero."""
    return bool(abs(found.theta[0]) > CONFIDENCE * found.deviation[0])


def _bounded(A: Array, y: Array, *, divided: bool) -> tuple[Fit, list[int]]:
    """Fit, and hold at zero one after the other what would be negative; the last column, the offset, has no sign.

    If ``divided``, the first column is that of 1 / k, by which the others are divided, and has any sign. Returns the
    fit, in which held columns are zeros, and the columns that were fitted.
    """
    free = list(range(A.shape[1]))
    while True:
        kept = np.zeros_like(A)
        kept[:, free] = A[:, free]
        found = fit(kept, y)
        sign = float(np.sign(found.theta[0])) if divided else 1.0
        significance = sign * found.theta / np.maximum(found.deviation, _TINY)
        wrong = [k for k in free[:-1] if significance[k] < 0.0 and not (divided and k == 0)]
        if not wrong:
            return found, free
        free.remove(min(wrong, key=lambda k: significance[k]))


def _divided(bounded: tuple[Fit, list[int]]) -> tuple[Array, Array, list[int]]:
    """Parameters, standard deviations and fitted columns from a regression divided by k: k = 1 / theta_0, and
    p_i = theta_i / theta_0.
    """
    found, free = bounded
    kappa = found.theta[0]
    theta = found.theta / kappa
    theta[0] = 1.0 / kappa
    slope = np.eye(len(theta)) / kappa
    slope[:, 0] = -found.theta / kappa**2
    slope[0, 0] = -1.0 / kappa**2
    return theta, np.sqrt(np.maximum(np.diag(slope @ found.covariance @ slope.T), 0.0)), free


def _named(theta: Array, deviation: Array, free: Sequence[int], whole: Fit, names: Sequence[str]) -> JointFit:
    """Result with the names of what is held and of what is not excited, which the fit of all columns shows."""
    at_zero = [k for k in range(len(names)) if k not in free]
    deviation = deviation.copy()
    deviation[at_zero] = np.nan
    unseen = tuple(" and ".join(names[k] for k in each) for each in whole.unseen)
    held = tuple(f"{names[k]} held at zero" for k in at_zero)
    return JointFit(theta, deviation, held, whole.singular_values, unseen)


def smoothed_motion(t: Array, q: Array, u: Array, half_window: float, degree: int) -> SmoothedMotion:
    """Smooth one log, without the torque of the links: t (n,) [s], q, u (n, nv); stamps with too few around are left
    out.
    """
    position = smooth(t, q, half_window, degree)
    inputs = smooth(t, u, half_window, degree)
    known = position.known & inputs.known
    least = _least_speed(t, position.slope, half_window)
    known &= np.isfinite(least).all(axis=1)
    parts = (t, position.value, position.slope, position.curvature, inputs.value, least)
    return SmoothedMotion(*(each[known] for each in (*parts, np.zeros_like(q))))


def _least_speed(t: Array, v: Array, half_window: float) -> Array:
    """Least speed (n, nv) within +- half_window [s] of each stamp; 0 where v (n, nv) changes its sign, NaN where some
    of it is not known.
    """
    first, last = np.searchsorted(t, t - half_window), np.searchsorted(t, t + half_window, side="right")
    low = np.array([v[i:k].min(axis=0) for i, k in zip(first, last, strict=True)])
    high = np.array([v[i:k].max(axis=0) for i, k in zip(first, last, strict=True)])
    return np.asarray(np.where(low * high < 0.0, 0.0, np.minimum(np.abs(low), np.abs(high))), dtype=np.float64)


def time_offset(
    motions: Sequence[SmoothedMotion], theta: Sequence[Array], slowest: float, longest: float
) -> tuple[float, float]:
    """Time [s] by which the inputs are stamped later than the positions, and half its interval of 95 %.

    ``longest`` [s] is the longest that is looked for. NaN where the least residual is at that end.
    """
    shifts = np.linspace(-longest, longest, _SHIFTS)
    cost = np.zeros(len(shifts))
    for i, shift in enumerate(shifts):
        for motion in motions:
            for j, own in enumerate(theta):
                # Where the joint does not turn around within the shift: there its friction jumps.
                rows = moving(motion, j, slowest)
                inside = (motion.t[rows] + longest <= motion.t[-1]) & (motion.t[rows] - longest >= motion.t[0])
                rows = rows[inside]
                u = np.interp(motion.t[rows] + shift, motion.t, motion.u[:, j])
                known = regressor(motion, j)[rows]
                residual = u - predicted(motion, j, own)[rows]
                scale = (motion.u[rows, j] - predicted(motion, j, own)[rows]).var()
                left = residual - known @ np.linalg.lstsq(known, residual, rcond=None)[0]
                independent = 1.0 / (1.0 + 2.0 * correlated_for(left[:, np.newaxis]))
                cost[i] += independent * float(left @ left) / max(scale, _TINY)
    best = int(cost.argmin())
    if best in (0, len(shifts) - 1):
        return float("nan"), float("nan")
    step = shifts[1] - shifts[0]
    before, at, after = cost[best - 1 : best + 2]
    curvature = before - 2.0 * at + after
    offset = float(shifts[best] + 0.5 * step * (before - after) / curvature)
    return offset, float(CONFIDENCE * step * np.sqrt(2.0 / curvature)) if curvature > 0.0 else float("nan")
