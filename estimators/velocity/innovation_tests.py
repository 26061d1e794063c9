"""Tests of the innovations of an observer of velocities, and the error of the velocity that they show.

At each reading, h after the one before, a law gives its innovation L (n,), the variance P of its prediction and the
share alpha of L by which it moves its position. With R, the variance of a reading, and Delta, the steps of encoders,

    e_i = sgn(L_i) max(|L_i| - Delta_i - 0.001 s h / alpha_i, 0) / sqrt(P_i + R_i)

is tested over windows of 0.02 to 1 s, by its mean and its spread (``mathnavi.estimators.integrity.windows``). Rounding
explains half a step of the reading, and half of the prediction that has followed it; an error of the velocity below a
thousandth of s, the greatest speed of the last second, counts as none. An alarm is DEGRADED for a second. Tests begin
when a law has had the time to settle.

**The error that the readings show.** A position is moved by v^ h between readings and by alpha L at them, and follows
the true one: so

    v - v^  =  mean of alpha L / h,

whatever the model. Its low-pass z over four and over sixteen readings' worth 1 / alpha of memory, less what noise makes
of it, is the part of the declared deviation that the gains alone do not know. If after an alarm |z| is more than
s / 2, the estimate says nothing of the velocity, and is LOST.

The spread of innovations also says by how much they are larger than declared, at least, and sooner than an alarm does:
r_i, the largest sum e_i^2 / chi2_c(0.1) over the windows, where one is beyond chi2_c(0.001). All of it is put to the
prediction: variances are larger by (r (P + R) - R) / P.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.windows import CLIP, ENERGY, MEAN, Thresholds, Windows
from mathnavi.estimators.velocity.gain_covariance import Residual
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers, Status
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.tolerances import TIME_TOLERANCE

_WINDOWS = (0.02, 0.1, 0.4, 1.0)  # [s]
_KAPPA = 1.2  # variance of innovations over the declared one: gains are not optimal, and innovations not quite white
_HELD = 1.0  # [s] for which an alarm lasts
_EARLIEST, _READINGS = 0.25, 50  # [s] and readings after a start from which on there are tests
_LIKELY, _UNLIKELY = 0.1, 1e-3  # levels of what the innovations exceed by chance
_SLOWER = np.array([4.0, 16.0])  # times the memory 1 / alpha of a law, of the two low-passes
_BY_NOISE = np.array([3.0, 2.0])  # deviations of each that noise explains
_SPEED_MEMORY, _SHARE = 1.0, 0.5  # [s] of the greatest speed, and the share of it beyond which nothing is known
_NOTHING = 1e-3  # of the greatest speed, below which an error is none
_VISIBLE, _LASTING = 0.01, 0.25  # of the greatest speed, of an error that matters, and [s] after it was seen
_LARGEST = 1e6  # of a factor of variances
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
        freedom = np.arange(1, int(self._thresholds.lengths[-1]) + 1)
        self._likely, self._unlikely = (np.append(math.inf, chdtri(freedom, level)) for level in (_LIKELY, _UNLIKELY))
        self._every, self._nothing = np.ones(n, dtype=np.bool_), np.full(n, np.nan)
        settles = settling if math.isfinite(settling) else 0.0
        self._grace = max(settles, _EARLIEST, _READINGS * mission.period)
        self._z, self._variance = np.zeros((2, n)), np.zeros((2, n))
        self._e, self._speed = np.zeros(n), 0.0
        self._begin, self._alarmed, self._lost, self._seen = math.inf, -math.inf, -math.inf, -math.inf  # [s]
        self.ratio = 0.0
        """the worst statistic over its threshold"""
        self.message = ""
        self.factor = np.ones(n)
        """factors (n,) >= 1 of the variances of the estimate"""
        self.shown = np.zeros(n)
        """errors (n,) [rad/s, m/s] of the velocities that the readings show, beyond what noise explains"""

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
        R, steps = noise
        L, P, gain = residual
        least = _NOTHING * self._speed
        _weigh(L, P, gain, R, steps, least, h, _SLOWER, self._e, self._z, self._variance)
        known = np.abs(self._z) - _BY_NOISE[:, np.newaxis] * np.sqrt(self._variance)
        self.shown = np.maximum(known, 0.0).max(axis=0)
        self._speed = max(self._speed * math.exp(-h / _SPEED_MEMORY), float(np.abs(rate + self._z[0]).max()))
        if float(self.shown.max()) > _VISIBLE * self._speed:
            self._seen = t
        if t < self._begin - TIME_TOLERANCE:
            return
        windows = self._windows
        windows.add(self._e, self._nothing)
        worst = windows.worst(self._every)
        self.ratio = worst.ratio
        r = np.ones(len(R))
        _excess(windows.sums, windows.k, self._thresholds.lengths, windows.kappa, self._likely, self._unlikely, r)
        self.factor = np.minimum((r * (P + R) - R) / np.maximum(P, 1e-30), _LARGEST)
        if worst.ratio > 1.0:
            self._alarmed = t
            word = _WORDS.get(worst.test, "sum")
            self.message = f"disagrees with its readings: the {word} of the innovations of {self._names[worst.channel]}"
        if t - self._alarmed < _HELD and float(self.shown.max()) > _SHARE * self._speed:
            self._lost = t

    def status(self, t: float) -> Status:
        """Status at t [s] as far as the readings agree with the estimate."""
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
        position, velocity = np.split(known * np.sqrt(np.concatenate([self.factor, self.factor])), 2)
        return np.concatenate([position, np.sqrt(np.square(velocity) + self._unknown())])

    def _unknown(self) -> Array:
        """Variances (n,) of the velocities that no gain knows."""
        unknown: Array = np.square(self.shown) + (_NOTHING * self._speed / 3.0) ** 2
        return unknown

    def covariance(self, known: Array) -> Array:
        """Covariance (N, N) of a state, where that of a law is ``known`` (N, N)."""
        n = len(self.factor)
        if len(known) != 2 * n:  # coordinates are not components
            return known * float(self.factor.max())
        if not self.shown.any() and (self.factor == 1.0).all():
            return known
        scale = np.sqrt(np.concatenate([self.factor, self.factor]))
        larger: Array = known * np.outer(scale, scale)
        larger[range(n, 2 * n), range(n, 2 * n)] += np.square(self.shown)
        return larger


@njit(cache=True, nogil=True)
def _weigh(
    L: Array,
    P: Array,
    gain: Array,
    R: Array,
    steps: Array,
    least: float,
    h: float,
    slower: Array,
    e: Array,
    z: Array,
    variance: Array,
) -> None:
    """Normalise innovations L (n,) to e (n,), and update the means z (2, n) of gain L / h with their ``variance``.

    ``least`` [rad/s, m/s] is an error of the velocity that counts as none.
    """
    for i in range(len(L)):
        S = P[i] + R[i]
        beyond = max(abs(L[i]) - steps[i] - least * h / max(gain[i], 1e-6), 0.0)
        e[i] = math.copysign(beyond / math.sqrt(S), L[i]) if S > 0.0 else 0.0
        for k in range(len(slower)):
            kept = math.exp(-gain[i] / slower[k])
            z[k, i] = kept * z[k, i] + (1.0 - kept) * gain[i] * L[i] / h
            variance[k, i] = kept**2 * variance[k, i] + ((1.0 - kept) * gain[i] / h) ** 2 * S


@njit(cache=True, nogil=True)
def _excess(sums: Array, k: int, lengths: Integers, kappa: float, likely: Array, unlikely: Array, r: Array) -> None:
    """Write by how much the innovations of each channel are larger than declared, at least, to r (l,)."""
    size, l = len(sums), len(r)  # noqa: E741
    now = sums[k % size]
    for i in range(l):
        found, beyond = 1.0, False
        for n in lengths:
            then = sums[(k - min(n, k)) % size]
            count = int(now[2 * l + i] - then[2 * l + i] + 0.5)
            squares = (now[l + i] - then[l + i]) / kappa
            if count > 0:
                found, beyond = max(found, squares / likely[count]), beyond or squares > unlikely[count]
        r[i] = found if beyond else 1.0
