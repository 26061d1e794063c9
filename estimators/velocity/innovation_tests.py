"""Tests of the innovations of an observer of velocities, and the error of the velocity that they show.

At each reading, h after the one before, a law gives its innovation L (n,), the variance P of its prediction and the
share alpha of L by which it moves its position. With R, the variance of a reading, and Delta, the steps of encoders,

    e_i = sgn(L_i) max(|L_i| - Delta_i - 0.001 s T_i, 0) / sqrt(P_i + R_i),    T_i = min(h / alpha_i, 0.25 s)

is tested over windows of 0.02 to 1 s, by its mean and its spread (``mathnavi.estimators.integrity.windows``). Rounding
explains half a step of the reading, and half of the prediction that has followed it; an error of the velocity below a
thousandth of s, the greatest speed of the last second, counts as none. At rest s is 0.1 rad/s and m/s, or a hundredth
of ``speed_max`` if that is less: an error is not compared with a motion that has ended. An alarm is DEGRADED for a
second. Tests begin when a law has had the time to settle, after 2 s at the latest; until then its word is not tested,
and that of a law that takes more than 1 s is DEGRADED: an error of its model is not told from that of its start.

**The error that the readings show.** A position is moved by v^ h between readings and by alpha L at them, and follows
the true one: so

    v - v^  =  mean of alpha L / h,

whatever the model; where closed chains open, by the way that observes it is moved, in place of alpha L. Its low-pass z
over one and over sixteen times the memory of a law, 1 / alpha, less what noise makes of it, is the part of the declared
deviation that the gains alone do not know. If after an alarm |z| is more than s / 2, the estimate says nothing of the
velocity, and is LOST.

The spread of the innovations of a coordinate also says by how much the variances of its position and its velocity are
larger than declared, at least, and sooner than an alarm does (``mathnavi.estimators.integrity.excess``).
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.integrity.excess import chances, factor_of
from mathnavi.estimators.integrity.windows import CLIP, ENERGY, MEAN, NOTHING, Flags, Thresholds, Windows, add, worst_of
from mathnavi.estimators.velocity.gain_covariance import Residual
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers, Status
from mathnavi.models.manifold.manifold import rate_starts
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.tolerances import TIME_TOLERANCE

_WINDOWS = (0.02, 0.1, 0.4, 1.0)  # [s]
_KAPPA = 1.2  # variance of innovations over the declared one: gains are not optimal, and innovations not quite white
_HELD = 1.0  # [s] for which an alarm lasts
_EARLIEST, _READINGS = 0.25, 50  # [s] and readings after a start from which on there are tests, at least
_LATEST = 2.0  # [s] likewise, at most: the variance of a prediction has the errors of a start
_TRUSTED = 1.0  # [s] for which the word of a law is taken without a test
_SLOWER_FAST, _SLOWER_SLOW = 1.0, 16.0  # times the memory 1 / alpha of a law, of the two low-passes
_BY_NOISE_FAST, _BY_NOISE_SLOW = 3.0, 2.0  # deviations of each that noise explains
_SPEED_MEMORY, _SHARE = 1.0, 0.5  # [s] of the greatest speed, and the share of it beyond which nothing is known
_NOTHING = 1e-3  # of the greatest speed, below which an error is none
_RESTING, _SLOWEST = 0.01, 0.1  # of speed_max, and [rad/s, m/s]: the greatest speed of a system at rest, at most
_VISIBLE, _LASTING = 0.01, 0.25  # of the greatest speed, of an error that matters, and [s] after it was seen
_ROUNDING = 1e-18  # [rad^2, m^2] of the numbers: a system at rest that is read exactly has no other error
_WORDS = {MEAN: "mean", ENERGY: "spread"}


class InnovationTests:
    """Tests of the innovations of an observer of n coordinates, and what they say of its errors."""

    def __init__(self, mission: LagrangianMission, settling: float) -> None:
        """``settling`` [s] is the time in which the errors of a start decay."""
        n = mission.system.manifold.dimension
        self._names = [
            name.partition(" [")[0] for name in mission.system.states[-mission.system.manifold.vector_size :]
        ]
        self._thresholds = Thresholds.of(n, mission.period, _WINDOWS, further=1)
        self._windows = Windows(self._thresholds, n, _KAPPA + CLIP**2 * mission.reading.jump)
        self._chances = chances(int(self._thresholds.lengths[-1]))
        settles = settling if math.isfinite(settling) else 0.0
        self._grace = max(min(settles, _LATEST), _EARLIEST, _READINGS * mission.period)
        self._z, self._variance = np.zeros((2, n)), np.zeros((2, n))
        self._resting = min(_RESTING * mission.speed_max, _SLOWEST)
        self._e, self._speed = np.zeros(n), self._resting
        self._read = np.ones(n, dtype=np.bool_)
        self._starts = rate_starts(mission.system.manifold).astype(np.int64)
        self._begin, self._alarmed, self._lost, self._seen = math.inf, -math.inf, -math.inf, -math.inf  # [s]
        self.ratio = 0.0
        """the worst statistic over its threshold"""
        self.message = ""
        self.factor = np.ones(n)
        """factors (n,) >= 1 of the variances of the estimate"""
        self.shown = np.zeros(n)
        """errors (n,) [rad/s, m/s] of the velocities that the readings show, beyond what noise explains"""

    def ignore(self, coordinates: slice) -> None:
        """Do not test these coordinates, which are no readings."""
        self._read[coordinates] = False

    def begin(self, t: float) -> None:
        """Begin again with a law that starts at t [s]."""
        self._windows.clear()
        self._z[:], self._variance[:] = 0.0, 0.0
        self._begin = t + self._grace
        self.factor, self.shown = np.ones(len(self.shown)), np.zeros(len(self.shown))

    def note(self, t: float, h: float, residual: Residual, noise: tuple[Array, Array], rate: Array) -> None:
        """Test a reading of t [s], h [s] after the one before, by its ``residual``.

        ``noise`` are the variances (n,) of the coordinates of a reading, and the steps (n,) to which they are rounded;
        ``rate`` (n,) are the estimated velocities at the reading.
        """
        windows, known, tested = self._windows, self._thresholds, t >= self._begin - TIME_TOLERANCE
        self._speed, most, self.ratio, test, channel = note(
            residual.value, residual.gain * residual.value if residual.moved is None else residual.moved,
            residual.variance, residual.gain, *noise, rate, self._starts, h, self._speed,
            self._resting, residual.used, tested, self._read,
            self._e, self._z, self._variance, self.shown, self.factor,
            windows.sums, windows.k, known.lengths, windows.kappa, known.z, known.energy, *self._chances,
        )  # fmt: skip
        if most > _VISIBLE * self._speed:
            self._seen = t
        if not tested:
            return
        windows.k += 1
        if self.ratio > 1.0:
            self._alarmed = t
            word = _WORDS.get(test, "sum")
            self.message = f"disagrees with its readings: the {word} of the innovations of {self._names[channel]}"
        if t - self._alarmed < _HELD and most > _SHARE * self._speed:
            self._lost = t

    def status(self, t: float) -> Status:
        """Status at t [s] as far as the readings agree with the estimate."""
        if t < self._begin - TIME_TOLERANCE and self._grace > _TRUSTED:
            self.message = "settles after its start"
            return Status.DEGRADED
        if t - self._lost < _HELD - TIME_TOLERANCE:
            return Status.LOST
        if t - self._alarmed < _HELD - TIME_TOLERANCE:
            return Status.DEGRADED
        self.message = ""
        return Status.OK

    def shows_error(self, t: float) -> bool:
        """True if the readings have just shown an error of the velocity, above a hundredth of the greatest speed."""
        return t - self._seen < _LASTING - TIME_TOLERANCE

    def deviation(self, known: Array) -> Array:
        """Standard deviations (2 n,) of positions and velocities, where those of a law are ``known`` (2 n,)."""
        declared: Array = declare(known, self.factor, self.shown, _NOTHING * self._speed / 3.0)
        return declared

    def covariance(self, known: Array) -> Array:
        """Covariance (N, N) of a state, where that of a law is ``known`` (N, N)."""
        n, most = len(self.factor), float(self.factor.max())
        if most == 1.0 and not self.shown.any():
            return known
        if len(known) != 2 * n:  # coordinates are not components
            return known * most
        scale = np.sqrt(np.concatenate([self.factor, self.factor]))
        larger: Array = known * np.outer(scale, scale)
        larger[range(n, 2 * n), range(n, 2 * n)] += np.square(self.shown)
        return larger


def tested_variance(P: Array, R: Array) -> Array:
    """Variances (n,) of innovations, by those of a prediction P (n,) and of a reading R (n,): S of the tests."""
    S: Array = P + R + _ROUNDING
    return S


@njit(cache=True, nogil=True)
def declare(known: Array, factor: Array, shown: Array, unknown: float) -> Array:
    """Deviations (2 n,) of variances that are larger by factors (n,), with errors ``shown`` (n,) and ``unknown``."""
    n, declared = len(factor), np.empty(len(known))
    for i in range(n):
        declared[i] = known[i] * math.sqrt(factor[i])
        declared[n + i] = math.sqrt(known[n + i] ** 2 * factor[i] + shown[i] ** 2 + unknown * unknown)
    return declared


@njit(cache=True, nogil=True)
def note(
    L: Array,
    moved: Array,
    P: Array,
    gain: Array,
    R: Array,
    steps: Array,
    rate: Array,
    starts: Integers,
    h: float,
    speed: float,
    resting: float,
    used: bool,
    tested: bool,
    read: Flags,
    e: Array,
    z: Array,
    variance: Array,
    shown: Array,
    factor: Array,
    sums: Array,
    k: int,
    lengths: Integers,
    kappa: float,
    z_limit: float,
    energy: Array,
    likely: Array,
    unlikely: Array,
) -> tuple[float, float, float, int, int]:
    """Take a reading; write e (n,), the means z (2, n) with their ``variance``, ``shown`` (n,) and ``factor`` (n,).

    The reading has ``moved`` (n,) the position, if it was used; ``rate`` (n,) are velocities, of which those of joint j
    begin at ``starts[j]``; ``read`` (n,) says which coordinates are readings, and tested; ``speed`` is the greatest so
    far and ``resting`` that of a system at rest. Returns the greatest speed and the largest error that is shown
    [rad/s, m/s], the worst ratio, its test and channel.
    """
    n, least = len(L), _NOTHING * speed
    speed = max(speed * math.exp(-h / _SPEED_MEMORY), resting)
    most = 0.0
    for i in range(n):
        S = P[i] + R[i] + _ROUNDING
        beyond = max(abs(L[i]) - steps[i] - least * min(h / max(gain[i], 1e-6), _LASTING), 0.0)
        e[i] = math.copysign(beyond / math.sqrt(S), L[i])
        shown[i] = 0.0
        for j in range(2):
            if used:
                kept = math.exp(-gain[i] / (_SLOWER_FAST if j == 0 else _SLOWER_SLOW))
                z[j, i] = kept * z[j, i] + (1.0 - kept) * moved[i] / h
                by_reading = R[i] + min(P[i], R[i])  # not by an unknown start: that is an error, and shown as one
                variance[j, i] = kept**2 * variance[j, i] + ((1.0 - kept) * gain[i] / h) ** 2 * by_reading
            by_noise = (_BY_NOISE_FAST if j == 0 else _BY_NOISE_SLOW) * math.sqrt(variance[j, i])
            shown[i] = max(shown[i], abs(z[j, i]) - by_noise)
        if read[i]:
            most = max(most, shown[i])
        factor[i] = 1.0
    for joint in range(len(starts)):
        end, square = starts[joint + 1] if joint + 1 < len(starts) else n, 0.0
        for i in range(starts[joint], end):
            square += (rate[i] + z[0, i]) ** 2
        speed = max(speed, math.sqrt(square))
    if not tested:
        return speed, most, 0.0, NOTHING, -1
    add(sums, k, e, np.full(n, np.nan))
    ratio, test, channel = worst_of(sums, k + 1, read, lengths, kappa, z_limit, energy)
    for i in range(n):
        factor[i] = factor_of(sums, k + 1, (n + i, 2 * n + i), lengths, kappa, likely, unlikely, P[i], R[i])
    return speed, most, ratio, test, channel
