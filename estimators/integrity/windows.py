"""Windowed tests of innovations, and the thresholds at which they alarm.

At each update the channels i = 1 ... l of the readings have innovations nu (l,) with the covariance S (l, l), both from
the prediction: before a reading is used. With S = L L', the normalised and the whitened ones are

    e_i = nu_i / sqrt(S_ii),      w = L^-1 nu,

of mean zero and of variance kappa >= 1, the variance over the declared one; w are independent of each other and between
updates if the estimate is consistent. Of windows of n updates, at the level alpha:

    mean      |sum e_i| / sqrt(kappa c_i)    over z(alpha / 2)           bias, scale
    energy    sum e_i^2 / kappa              over chi2_(c_i)(alpha)      noise, a beam that is blocked
    joint     sum w'w / kappa                over chi2_c(alpha)          a pose that is another

c the number of innovations in the window. A ratio above one is an alarm. e^2 and w'w count as at most 4 deviations, and
a mean is that of smaller e, so a single outlier is no alarm. The level is shared, by Bonferroni, over all tests
and all times of a horizon, whatever their dependence: alpha = P / (tests x updates in the horizon), P being the
probability of a false alarm in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers

Flags = NDArray[np.bool_]
CLIP = 4.0
"""largest magnitude of a normalised innovation that counts"""
FEWEST = 3
"""number of innovations in a window from which on it is tested"""
NOTHING, MEAN, ENERGY, JOINT, RECKONED, SEPARATED, IMPOSSIBLE = range(7)
"""tests, by number: none, of the windows, of dead reckoning, of an estimate without a channel, and of what an estimate
can be"""

_FALSE_ALARM, _HORIZON = 0.01, 60.0  # probability of a false alarm in a time [s]
SOFT = 1e-3
"""level of a channel that is to be used again"""


class Worst(NamedTuple):
    """The largest statistic over its threshold, the test, and the channel or -1."""

    ratio: float
    test: int
    channel: int


QUIET = Worst(0.0, NOTHING, -1)
"""nothing was tested"""


@dataclass(frozen=True, eq=False)
class Thresholds:
    """Windows and levels of a monitor of l channels."""

    lengths: Integers  # (w,) updates
    alpha: float  # level of each test
    z: float
    energy: Array  # (n + 1,) of chi-square, by degrees of freedom
    soft_z: float
    soft_energy: Array

    @staticmethod
    def of(channels: int, period: float, windows: tuple[float, ...], further: int = 0) -> Thresholds:
        """Thresholds for updates every ``period`` [s] and windows [s]; ``further`` is the number of other tests."""
        lengths = np.unique([max(FEWEST + 1, round(each / period)) for each in windows])
        tests = len(lengths) * (2 * channels + 1) + further
        alpha = _FALSE_ALARM / (tests * max(1.0, _HORIZON / period))
        freedom = np.arange(1, int(lengths[-1]) * channels + 1)
        soft = np.arange(1, int(lengths[-1]) + 1)
        return Thresholds(
            lengths.astype(np.int64),
            float(alpha),
            float(-ndtri(0.5 * alpha)),
            np.append(math.inf, chdtri(freedom, alpha)),
            float(-ndtri(0.5 * SOFT)),
            np.append(math.inf, chdtri(soft, SOFT)),
        )


class Windows:
    """Sums of the innovations of l channels over the last updates."""

    def __init__(self, thresholds: Thresholds, channels: int, kappa: float = 1.0) -> None:
        """``kappa`` is the variance of the innovations over the declared one, with the outliers that are declared."""
        self.kappa = self.declared = kappa
        self._channels, self.thresholds = channels, thresholds
        self.sums = np.zeros((int(thresholds.lengths[-1]) + 1, 3 * channels + 2))
        """running sums of e, e^2 and 1 by channel, then of w'w and 1, in a ring"""
        self.k = 0
        """updates so far"""

    def clear(self) -> None:
        """Forget everything."""
        self.sums[:] = 0.0
        self.k = 0

    def forget(self, channel: int) -> None:
        """Forget what a channel read so far."""
        self.sums[:, channel : 3 * self._channels : self._channels] = 0.0

    @property
    def excess(self) -> float:
        """kappa over the declared one: larger than one where the noise was found to be larger."""
        return self.kappa / self.declared

    def expect(self, kappa: float) -> None:
        """Declare another variance of the innovations; what was found to be larger stays larger by as much."""
        self.kappa, self.declared = kappa * self.excess, kappa

    def copy(self) -> Windows:
        """A copy with its own sums."""
        made = object.__new__(Windows)
        made.kappa, made.declared = self.kappa, self.declared
        made._channels, made.thresholds = self._channels, self.thresholds
        made.sums, made.k = self.sums.copy(), self.k
        return made

    def add(self, e: Array, white: Array) -> None:
        """Add the innovations of an update: e (l,) and w (l,), NaN where nothing was read, or used."""
        add(self.sums, self.k, e, white)
        self.k += 1

    def worst(self, used: Flags, *, shorter: bool = False) -> Worst:
        """The worst test over the channels that are ``used`` (l,), in all windows, or in the ``shorter`` ones."""
        known = self.thresholds
        lengths = known.lengths[:-1] if shorter else known.lengths
        return Worst(*worst_of(self.sums, self.k, used, lengths, self.kappa, known.z, known.energy))

    def of_channel(self, channel: int) -> float:
        """The largest ratio of a channel's own tests."""
        known = self.thresholds
        return float(worst_of_channel(self.sums, self.k, channel, known.lengths, self.kappa, known.z, known.energy))

    def is_quiet(self, channel: int, length: int) -> bool:
        """True if the last ``length`` updates of a channel pass its tests at the soft level."""
        if self.k < length:
            return False
        sums = self._since(length)
        e, squares, count = sums[channel : 3 * self._channels : self._channels]
        if count < FEWEST:
            return False
        mean = abs(e) / math.sqrt(self.kappa * count)
        most = self.kappa * self.thresholds.soft_energy[round(count)]
        return bool(mean <= self.thresholds.soft_z and squares <= most)

    def joint(self, length: int) -> tuple[float, int]:
        """Sum of w'w over the last ``length`` updates, and their number."""
        sums = self._since(length)
        return float(sums[-2]), round(float(sums[-1]))

    def _since(self, length: int) -> Array:
        """Sums over the last ``length`` updates, or over all."""
        size = len(self.sums)
        sums: Array = self.sums[self.k % size] - self.sums[(self.k - min(length, self.k)) % size]
        return sums


@njit(cache=True, nogil=True)
def add(sums: Array, k: int, e: Array, white: Array) -> None:
    """Write the running sums of update k + 1 behind those of k."""
    size, l = len(sums), len(e)  # noqa: E741
    before, after = sums[k % size], sums[(k + 1) % size]
    after[:] = before
    for i in range(l):
        if math.isfinite(e[i]):
            if abs(e[i]) <= CLIP:  # the mean of outliers is that of no bias: one that is larger has the larger spread
                after[i] += e[i]
            after[l + i] += min(e[i] * e[i], CLIP * CLIP)
            after[2 * l + i] += 1.0
        if math.isfinite(white[i]):
            clipped = min(max(white[i], -CLIP), CLIP)
            after[3 * l] += clipped * clipped
            after[3 * l + 1] += 1.0


@njit(cache=True, nogil=True)
def worst_of(
    sums: Array, k: int, used: Flags, lengths: Integers, kappa: float, z: float, energy: Array
) -> tuple[float, int, int]:
    """The worst ratio, its test and its channel."""
    size, l = len(sums), len(used)  # noqa: E741
    ratio, test, channel = 0.0, NOTHING, -1
    now = sums[k % size]
    for n in lengths:
        then = sums[(k - min(n, k)) % size]
        for i in range(l):
            count = now[2 * l + i] - then[2 * l + i]
            if not used[i] or count < FEWEST:
                continue
            mean = abs(now[i] - then[i]) / math.sqrt(kappa * count) / z
            squares = (now[l + i] - then[l + i]) / (kappa * energy[int(count + 0.5)])
            if mean > ratio:
                ratio, test, channel = mean, MEAN, i
            if squares > ratio:
                ratio, test, channel = squares, ENERGY, i
        count = now[3 * l + 1] - then[3 * l + 1]
        if count >= FEWEST:
            joint = (now[3 * l] - then[3 * l]) / (kappa * energy[int(count + 0.5)])
            if joint > ratio:
                ratio, test, channel = joint, JOINT, -1
    return ratio, test, channel


@njit(cache=True, nogil=True)
def worst_of_channel(sums: Array, k: int, i: int, lengths: Integers, kappa: float, z: float, energy: Array) -> float:
    """The worst ratio of one channel's mean and energy."""
    size = len(sums)
    l = (sums.shape[1] - 2) // 3  # noqa: E741
    now, ratio = sums[k % size], 0.0
    for n in lengths:
        then = sums[(k - min(n, k)) % size]
        count = now[2 * l + i] - then[2 * l + i]
        if count >= FEWEST:
            ratio = max(ratio, abs(now[i] - then[i]) / math.sqrt(kappa * count) / z)
            ratio = max(ratio, (now[l + i] - then[l + i]) / (kappa * energy[int(count + 0.5)]))
    return ratio
