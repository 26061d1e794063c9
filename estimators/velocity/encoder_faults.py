"""Encoders that fail, as their readings show it without a model: those that repeat themselves, and those that leap.

The readings of attitudes are three of them each, the sums of the turns about the axes of the body, from reading to
reading.

**Repeats.** Of an encoder with noise sigma and steps Delta two readings are alike with a probability of at most

    p = sum_k (Phi((k + 1/2) Delta / sigma) - Phi((k - 1/2) Delta / sigma))^2,

so one that reads the same n times again, p^n < 1e-12, is stuck. The variance sigma^2 is no larger than declared, nor
than half of what the readings have shown where they were the quietest: where rounding may be all there is of it, an
encoder may repeat itself as long as it likes.

**Leaps.** A joint does not leap. With lines through the four readings before and the four after a gap, d is the lesser
of what lies between them at its two ends, 0 where they cross in it, as under any force that changes the velocity. An
encoder has leapt by d if that is beyond 8 of its deviations, declared or shown, three times what the joint moves from
reading to reading, and what an acceleration of 2000 rad/s^2 or m/s^2 can do. A motion that is more sudden, as that of
a light finger against a stop, is none if the observer has predicted more than 0.3 |d| of it. What it has not may be
less: beyond 8 deviations, four times what its predictions were off at most lately, and the second differences of the
readings on either side, which any motion with a bounded acceleration shows. In contact, or where none is known of, a
joint may be bumped between readings: then d is also beyond what 5 rad/s or m/s do in that time, and never less.

Either place may be the right one: |d|, or the sum of several leaps, is a deviation of the position until it leaps back,
to a tenth of the largest or within 8 deviations.

**Late readings.** Where encoders leap together, each back along its motion by what it takes the same time tau for,

    d_i = -v_i tau,    tau = -sum_i d_i v_i / R_i / sum_i v_i^2 / R_i,

all of them within 4 deviations and two at least by more than 8, readings are late by tau. They are until encoders leap
ahead by as much, to within 0.3 tau; where all stand then, that is not seen.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mathnavi.estimators.integrity.repeats import STUCK
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE

_SIDE = 4  # readings of a line
_CHANCE, _LIKELY = 1e-12, 0.9  # of a run of repetitions, and of one, from which on repetitions say nothing
_SHARE = 0.5  # of the variance that readings show, that is surely noise
_DEVIATIONS, _STEPS, _FASTEST = 8.0, 3.0, 2000.0  # of a leap; [rad/s^2, m/s^2]
_BACK = 0.1  # of the largest leap, within which an encoder has leapt back
_ROUNDING = 1e-18  # [rad^2, m^2] of readings without errors
_GAP = 2.1  # intervals between readings, of which one is missing, with some jitter
_STUCK_FOR, _LEAPT_FOR = 1.0, 5.0  # [s] of doubt after a repetition, and after a leap
_FEWEST = 100  # readings that were predicted, from which on predictions count
_KEPT, _TIMES, _PREDICTED = 0.998, 4.0, 0.3  # of the largest error from reading to reading; times it; share of a leap
_BUMP = 5.0  # [rad/s, m/s] of a joint that is bumped
_ALIKE, _SEEN, _LATE, _IN_TIME = 4.0, 8.0, 2, 0.3  # deviations; encoders that show a delay; share of it


class EncoderErrors(NamedTuple):
    """Errors (k,) of the readings of k encoders: variances [rad^2, m^2], and steps [rad, m]."""

    noise: Array  # as declared, without rounding; 0 where nothing is
    shown: Array  # as the readings have shown lately
    least: Array  # likewise, while they were the quietest
    steps: Array  # 0 without


class EncoderFaults:
    """Repetitions and leaps of k encoders."""

    def __init__(self, names: list[str], period: float) -> None:
        """``names`` are those of what they read, ``period`` [s] is the nominal time between readings."""
        k = len(names)
        self._names, self._gap = names, _GAP * period
        self._times, self._readings, self._count = np.zeros(2 * _SIDE), np.zeros((2 * _SIDE, k)), 0
        self._enough = np.full(k, math.inf)
        self.repeats = np.zeros(k)
        """repetitions (k,) in a row so far"""
        self._leap, self._largest = np.zeros(k), np.zeros(k)  # of this reading, and of all so far
        self._lines = np.zeros((5, k))  # of this reading, see ``leaps``
        self._off = np.full((2 * _SIDE, k), np.nan)  # of the readings, what was not predicted
        self._free = 0  # readings in sequence without contacts
        self._usual, self._predicted = np.zeros(k), 0  # the largest of it lately, and the number of predictions
        self.delay = 0.0
        """time [s] by which all readings are late"""
        self._in_time = np.zeros((2, k))  # offset and largest leap before they were
        self.offset = np.zeros(k)
        """sums (k,) [rad, m] of the leaps of encoders that have not leapt back"""
        self.turned = np.zeros(k, dtype=np.bool_)
        """True (k,) for hinges whose turns are not known"""
        self._until, self._doubt = -math.inf, ""  # [s]

    @property
    def deviation(self) -> Array:
        """Deviations (k,) [rad, m] of the positions by leaps and unknown turns, beside those of the readings."""
        deviation: Array = np.abs(self.offset) + 2.0 * math.pi * self.turned
        return deviation

    def doubt(self, t: float) -> str:
        """Why an estimate of t [s] is doubted; "" if it is not."""
        if t < self._until - TIME_TOLERANCE:
            return self._doubt
        return f"has readings that are {self.delay:.3f} s late" if self.delay else ""

    def read(
        self, t: float, y: Array, errors: EncoderErrors, off: Array | None = None, *, touching: bool = False
    ) -> None:
        """Take readings y (k,) of t [s] with their ``errors``, ``off`` (k,) from what was predicted, if it was; whether
        joints or bodies were ``touching`` something.
        """
        if self._count and not 0.0 < t - self._times[-1] <= self._gap:
            self._count = 0
        self._times[:-1], self._readings[:-1] = self._times[1:], self._readings[1:]
        self._times[-1], self._readings[-1] = t, y
        self._expect(off)
        self._free = 0 if touching else self._free + 1
        self._count += 1
        if self._count < 2:
            self.repeats[:] = 0.0
            return
        same = y == self._readings[-2]
        if same.any():
            self._repeat(t, same, errors)
        self.repeats[~same] = 0.0
        if self._count < 2 * _SIDE:
            return
        variance = np.maximum(errors.noise + np.square(errors.steps) / 12.0, errors.shown)
        leaps(self._times, self._readings, variance, self._leap, self._lines)
        if self._predicted >= _FEWEST:
            self._unpredicted(variance)
        if self._free < 2 * _SIDE:
            self._leap[np.abs(self._leap) <= _BUMP * (self._times[_SIDE] - self._times[_SIDE - 1])] = 0.0
        if self.offset.any():
            d, known = self._lines[0], _DEVIATIONS * np.sqrt(variance)
            within = np.abs(self.offset + d) <= np.maximum(_BACK * self._largest, known)
            back = (self.offset != 0.0) & within & (np.abs(d) > np.sqrt(self._lines[2]) * known)
            self._leap[back] = d[back]  # however fast the joint moves
        if self._leap.any() and not self._is_in_time(variance):
            self._leapt(t, variance)

    def stands(self, t: float, joint: str) -> None:
        """Doubt the encoder of a joint that stands at t [s] while the model moves it."""
        self._until, self._doubt = max(self._until, t + _STUCK_FOR), f"has an encoder that stands: {joint}"

    def forget(self) -> None:
        """Begin again with readings that are not related to those before; leaps are remembered."""
        self._count = 0

    def _expect(self, off: Array | None) -> None:
        """Keep what a reading is off from its prediction, and the largest of it before the gap between the lines."""
        if off is None:
            self._off[:], self._predicted = np.nan, 0
            return
        before = np.abs(self._off[_SIDE])
        self._off[:-1], self._off[-1] = self._off[1:], off
        if np.isfinite(before).all():
            self._usual = np.maximum(_KEPT * self._usual, before)
            self._predicted += 1

    def _unpredicted(self, variance: Array) -> None:
        """Note no leap that was predicted, and smaller ones too where predictions have been right."""
        d, off, known = self._lines[0], self._off[_SIDE], _DEVIATIONS * np.sqrt(self._lines[2] * variance)
        limit = np.maximum(np.maximum(known, self._lines[4]), _TIMES * self._usual)
        unpredicted = np.abs(off - d) <= _PREDICTED * np.abs(d)
        if self._free >= 2 * _SIDE:
            found = (np.abs(d) > limit) & unpredicted
            self._leap[found] = d[found]
        self._leap[~unpredicted] = 0.0

    def _repeat(self, t: float, same: Flags, errors: EncoderErrors) -> None:
        for i in np.flatnonzero(same):
            self.repeats[i] += 1.0
            if self.repeats[i] == STUCK:  # what it has shown so far is still that of the readings before
                step = float(errors.steps[i])
                sure = min(float(errors.noise[i]), _SHARE * float(errors.least[i]) - step * step / 12.0)
                self._enough[i] = repetitions(math.sqrt(max(sure, 0.0)), step)
            elif self.repeats[i] < STUCK:
                self._enough[i] = math.inf
            if self.repeats[i] >= self._enough[i]:
                self._until = max(self._until, t + _STUCK_FOR)
                self._doubt = f"reads the same {self._names[i]} again and again"
                self._count = min(self._count, 1)  # that it goes on elsewhere is no leap

    def _is_in_time(self, variance: Array) -> bool:
        """True if readings that were late are in time again; notes the delay of those that are late now."""
        (d, v, of_d, of_v), variance = self._lines[:4], np.maximum(variance, _ROUNDING)
        motion = float((v * v / variance).sum())
        tau = -float((d * v / variance).sum()) / motion if motion > 0.0 else 0.0
        deviation = np.sqrt(variance * (of_d + tau * tau * of_v))
        if not (np.abs(d + v * tau) <= _ALIKE * deviation).all():
            return False
        seen = int(np.count_nonzero(np.abs(v * tau) > _SEEN * deviation))
        if self.delay and seen and abs(tau + self.delay) <= _IN_TIME * self.delay:
            self.delay, (self.offset[:], self._largest[:]) = 0.0, self._in_time
            return True
        if not self.delay and seen >= _LATE and tau > 0.0:
            self.delay, self._in_time = tau, np.stack([self.offset, self._largest])
        return False

    def _leapt(self, t: float, variance: Array) -> None:
        for i in np.flatnonzero(self._leap):
            d = self._leap[i]
            self._largest[i] = max(self._largest[i], abs(d))
            self.offset[i] += d
            if abs(self.offset[i]) <= max(_BACK * self._largest[i], _DEVIATIONS * math.sqrt(variance[i])):
                self.offset[i] = self._largest[i] = 0.0
                self._until = min(self._until, t + _STUCK_FOR)
            else:
                self._until = max(self._until, t + _LEAPT_FOR)
                self._doubt = f"has a sensor that has leapt, of {self._names[i]}"


def repetitions(sigma: float, step: float) -> float:
    """Number of repetitions in a row that chance does not explain, of readings with noise sigma rounded to ``step``."""
    if sigma <= 0.0:
        return math.inf
    if step <= 0.0:
        return STUCK
    edges = [
        0.5 * math.erf((k + 0.5) * step / (sigma * math.sqrt(2.0))) for k in range(math.ceil(8.0 * sigma / step) + 1)
    ]
    alike = (2.0 * edges[0]) ** 2 + 2.0 * sum((b - a) ** 2 for a, b in pairwise(edges))
    return math.inf if alike > _LIKELY else max(float(STUCK), math.ceil(math.log(_CHANCE) / math.log(alike)))


@njit(cache=True, nogil=True)
def leaps(times: Array, y: Array, variance: Array, leap: Array, lines: Array) -> None:
    """Write the leaps (k,) between the fourth and the fifth of the readings y (8, k) at ``times`` (8,), 0 for none.

    ``variance`` (k,) is that of a reading. Of the ``lines`` (5, k) on both sides are written what lies between them,
    their mean slope, the variances of both over that of a reading, and the largest second difference of the readings of
    a side.
    """
    half = len(times) // 2
    gap = times[half] - times[half - 1]
    middle, spread = np.zeros(2), np.zeros(2)
    for side in range(2):
        for j in range(half):
            middle[side] += times[side * half + j] / half
        for j in range(half):
            spread[side] += (times[side * half + j] - middle[side]) ** 2
    most = 0.0
    for end in range(2):
        factor = 2.0 / half
        for side in range(2):
            factor += (times[half - 1 + end] - middle[side]) ** 2 / spread[side]
        most = max(most, factor)
    for i in range(y.shape[1]):
        mean, slope = np.zeros(2), np.zeros(2)
        for side in range(2):
            for j in range(half):
                mean[side] += y[side * half + j, i] / half
            for j in range(half):
                slope[side] += (times[side * half + j] - middle[side]) * y[side * half + j, i] / spread[side]
        least, sign = math.inf, 0.0
        for end in range(2):
            t = times[half - 1 + end]
            d = mean[1] + slope[1] * (t - middle[1]) - mean[0] - slope[0] * (t - middle[0])
            if sign * d < 0.0:
                d = 0.0
            sign = d
            least = min(least, abs(d))
        limit = max(_DEVIATIONS * math.sqrt(most * variance[i]), 0.25 * _FASTEST * gap * gap)
        for j in range(1, 2 * half):
            if j != half:
                limit = max(limit, _STEPS * abs(y[j, i] - y[j - 1, i]) * gap / (times[j] - times[j - 1]))
        between = math.copysign(least, sign)
        bent = 0.0
        for j in range(2, 2 * half):
            if j not in (half, half + 1):
                bent = max(bent, abs(y[j, i] - 2.0 * y[j - 1, i] + y[j - 2, i]))
        lines[4, i] = bent
        leap[i] = between if least > limit else 0.0
        lines[0, i], lines[1, i] = between, 0.5 * (slope[0] + slope[1])
        lines[2, i], lines[3, i] = most, 0.25 * (1.0 / spread[0] + 1.0 / spread[1])
