"""Channels of a reading of a missile's state: position, velocity, attitude and rates, of which one can be left out.

Each of them follows from the others and the equations of motion, so a filter without one goes on. At an alarm of the
innovations four filters run again over the readings of the last 5 s, each without one of the channels. They differ from
the filter of all by delta and Delta in state and covariance, zero at the oldest reading; Phi being the transition of
the state between two readings, H that it is read, and - before a reading is used,

    delta^- = Phi delta,   Delta^- = Phi Delta Phi',   nu_c = nu - H delta^-,   S_c = S + H Delta^- H'.

With s = nu' S^-1 nu of a reading, by all channels, and s_c without one of n_c numbers, both clipped, and rho_c the mean
of s_c for each number that is read, at least one, the channel c explains the readings since one of them, k, by

    G_c = max over k of sum_(j >= k) ((s_j - s_cj) / rho_c - n_c),

about zero or less if all are as declared, or noisier. The channel with the largest G_c is left out where that is large,
and much larger than those of the others. So is one with noise that has read the same six times. It is read again once
it has agreed with the estimate for 2 s, and more than with one that is as far off as at first: the estimate may have
drifted there. Until 2 s later the estimate is DEGRADED.

A position that leaps by d, which no other channel tells, may be that of a missile that was moved, or of an estimate
that was wrong before. While it is left out d d' is added to the covariance. If it stays where it is for 20 s it is
followed, and leaps that were are added up to D, which leaves D D' in the covariance until a leap of -D undoes it. Where
another channel was left out, and agrees again within 4 s, the position has leapt instead, or that channel was off for a
moment; what the position is off from that by this channel counts as a leap. Readings that are late by tau leap by -tau
v: after a D against the velocity v the estimate is DEGRADED until then, for all channels may be late.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.innovations import LATCHED
from mathnavi.estimators.integrity.repeats import STUCK
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.tolerances import TIME_TOLERANCE

_KEPT, _MOST = 5.0, 256  # [s] of readings that are kept, and their number
_BEFORE, _SINCE, _AGAIN = 1.0, 3.0, 0.2  # [s] of readings before an alarm, after it, and between two attempts
_EXPLAINS, _MORE = 30.0, 12.0  # least G of a channel that is left out, and more than that of any other
_UNREAD = 1e8  # times the variance of a reading, of one that is not used
_CHANCE = 1e-9  # of the square of a reading from which on it counts no more
_AGREES, _RECENT = 2.0, 3.5  # [s] until a channel is read again; deviations of its mean
_SOON = 4.0  # [s] within which a channel agrees again where a position has leapt instead
_NEARER = 4.0  # least difference of squares by which that is nearer to none than to the first one
_NOISE = 2.0  # times the declared variance of one that is read again, at most
_ASIDE = 0.3  # of the length of a leap against the velocity, across it at most
_SETTLES = 2.0  # [s] from then on
_NAMES = {"m": "position", "m/s": "velocity", "rad": "attitude", "rad/s": "rates"}


class Reading(NamedTuple):
    """A reading that the filter has used."""

    Phi: Array  # (n, n) since the one before
    before: Array  # (n,) state before it
    P_before: Array  # (n, n)
    nu: Array  # (m,)
    after: Array  # (n,)
    P_after: Array  # (n, n)
    t: float  # [s]


class Channels:
    """Choice of the channels of a missile's readings."""

    def __init__(self, coordinates: Coordinates, R: Array, noisy: Flags, interval: float) -> None:
        """``R`` (m, m) is the covariance of a reading, of which the components that are ``noisy`` (m,) have noise;
        readings come every ``interval`` [s].
        """
        units = coordinates.units
        self._names = [*dict.fromkeys(_NAMES[unit] for unit in units)]
        self._rows = [
            np.array([k for k, unit in enumerate(units) if _NAMES[unit] == name], np.int64) for name in self._names
        ]
        self._coordinates, self._position = coordinates, self._names.index("position")
        self._is_late = False  # whether D may be that of late readings
        self._sizes = np.array([len(rows) for rows in self._rows])
        self._R, self._noisy, self._every = R, noisy, np.ones(len(units), dtype=np.bool_)
        self._without = np.array([R] * len(self._rows))
        for each, rows in zip(self._without, self._rows, strict=True):
            each[rows, rows] *= _UNREAD
        self._clip = float(chdtri(len(units), _CHANCE))
        self._readings: deque[Reading] = deque(maxlen=_MOST)
        self._last, self._repeats = np.full(len(units), math.nan), np.zeros(len(units), np.int64)
        self._out: int | None = None  # the channel that is left out
        self._left = -math.inf  # [s] since when
        self._first: tuple[Array, Array] | None = None  # its first mean innovation that disagreed, and the variances
        self._moved: tuple[Array, Array] | None = None  # the position without it less that by it [m], and the variances
        self._back = ""  # the channel that was left out last
        self._leapt: tuple[Array, Array] | None = None  # D [m] and its variances [m^2]
        self._recent: deque[tuple[Array, Array]] = deque(maxlen=max(10, round(_AGREES / interval)))
        self._alarm = math.inf  # [s] first of the alarms
        self._alarmed = self._tried = self._ended = -math.inf  # [s] last one, last attempt, and a channel read again

    @property
    def used(self) -> Flags | None:
        """The components (m,) that are to be used; None for all of them."""
        if self._out is None:
            return None
        used = self._every.copy()
        used[self._rows[self._out]] = False
        return used

    def doubt(self, t: float) -> str:
        """Channel that is left out at t [s], was read again shortly before, or may be late, in words; "" if none."""
        if self._out is not None:
            return f"leaves out the {self._names[self._out]}, which disagrees"
        if self._is_late:
            return "has readings that may be late"
        return f"reads the {self._back} again" if t - self._ended < _SETTLES else ""

    def add_leaps(self, P: Array) -> None:
        """Add D D' and d d' to a covariance P (nx, nx) of the state, in place."""
        leaps = [] if self._leapt is None else [self._leapt[0]]
        if self._out == self._position and self._recent:
            leaps.append(np.mean([nu for nu, _ in self._recent], axis=0))
        at = self._rows[self._position]
        for leap in leaps:
            P[np.ix_(at, at)] += np.outer(leap, leap)

    def begin_again(self, t: float) -> None:
        """Use all channels from t [s] on, of an estimate that may be anywhere."""
        self._readings.clear()
        if self._out is not None:
            self._read_again(t)

    def stuck(self, t: float, y: Array) -> tuple[Array, Array] | None:
        """Take what is read (m,) at t [s]. Where a channel is stuck, leave it out.

        Returns delta (n,) and Delta (n, n) without it after the last reading, None if no readings are kept.
        """
        self._repeats = np.where(y == self._last, self._repeats + 1, 0)
        self._last = y.copy()
        if self._out is not None or not (stuck := self._noisy & (self._repeats >= STUCK)).any():
            return None
        channel = next(k for k, rows in enumerate(self._rows) if stuck[rows].any())
        found = self._again() if self._readings else None
        self._leave_out(channel, t)
        return None if found is None else (found[1][channel], found[2][channel])

    def note(self, reading: Reading, S: Array, *, alarming: bool) -> tuple[Array, Array] | None:
        """Note a reading, with S (m, m) of its innovation, and whether it alarmed.

        Returns delta (n,) and Delta (n, n) of state and covariance where they are others: without a channel that is
        left out from now on, or at a position that is followed from now on.
        """
        t = reading.t
        if self._out is not None:
            return self._judge(reading, S)
        if t - self._alarmed > _SINCE:
            self._alarm = math.inf
        if alarming:
            self._alarm, self._alarmed = min(self._alarm, t), t
        if t - self._alarm > _SINCE:  # all readings that are kept have what alarms
            self._readings.clear()
            return None
        self._readings.append(reading)
        while self._readings[0].t < t - _KEPT:
            self._readings.popleft()
        if not alarming or self._readings[0].t > self._alarm - _BEFORE or t - self._tried < _AGAIN - TIME_TOLERANCE:
            return None
        self._tried = t
        gains, deltas, Deltas = self._again()
        channel, second = np.argsort(gains)[[-1, -2]].tolist()
        if gains[channel] < max(_EXPLAINS, float(gains[second]) + _MORE):
            return None
        self._leave_out(channel, t)
        if channel != self._position:
            at, two = self._rows[self._position], [channel, self._position]
            variances = 2.0 * reading.P_after + Deltas[two].sum(axis=0)
            self._moved = deltas[channel][at] - deltas[self._position][at], variances.diagonal()[at]
        return deltas[channel], Deltas[channel]

    def _leave_out(self, channel: int, t: float) -> None:
        self._out, self._left, self._first, self._moved = channel, t, None, None
        self._readings.clear()
        self._recent.clear()

    def _read_again(self, t: float) -> None:
        assert self._out is not None
        self._back, self._out, self._ended = self._names[self._out], None, t

    def _judge(self, reading: Reading, S: Array) -> tuple[Array, Array] | None:
        """Use the channel that is left out again once it agrees, or is a position that is to be followed."""
        assert self._out is not None
        rows, recent, t = self._rows[self._out], self._recent, reading.t
        variance, noise = S[rows, rows], self._R[rows, rows]
        recent.append((reading.nu[rows], reading.nu[rows] ** 2 / variance))
        if len(recent) < (recent.maxlen or 0) or self._repeats[rows].any():
            return None
        mean, square = (np.mean(each, axis=0) for each in zip(*recent, strict=True))
        spread = variance - noise + noise / len(recent)
        agrees = bool((np.abs(mean) <= _RECENT * np.sqrt(spread)).all() and (square <= _NOISE).all())
        if agrees and self._is_nearer(mean, spread, t):
            if self._moved is not None and t - self._left <= _SOON and self._is_leap(*self._moved):
                self._add_leap(*self._moved, reading.after)
            self._read_again(t)
            return None
        if self._first is None:
            self._first = mean, noise / len(recent)
        if self._out != self._position or (square - mean**2 / variance > _NOISE).any():
            return None
        if not self._is_undone(mean, spread) and t - self._left < LATCHED:
            return None
        self._add_leap(mean, spread, reading.after)
        self._read_again(t)
        delta, Delta = np.zeros(len(reading.after)), np.zeros_like(reading.P_after)
        delta[rows], Delta[rows, rows] = mean, noise / len(recent)
        return delta, Delta

    def _is_leap(self, d: Array, variance: Array) -> bool:
        return bool((np.abs(d) > _RECENT * np.sqrt(variance)).any())

    def _is_undone(self, d: Array, variance: Array) -> bool:
        """True where a leap d (3,) of the position, with its variances, undoes those that were."""
        if self._leapt is None:
            return False
        return bool((np.abs(self._leapt[0] + d) <= _RECENT * np.sqrt(self._leapt[1] + variance)).all())

    def _add_leap(self, d: Array, variance: Array, x: Array) -> None:
        """Add a leap d (3,) of the position, with its variances, at a state x (n,)."""
        undone, (D, unsure) = self._is_undone(d, variance), self._leapt or (np.zeros(len(d)), np.zeros(len(d)))
        self._leapt = None if undone else (D + d, unsure + variance)
        self._is_late = not undone and self._may_be_late(D + d, unsure + variance, x)

    def _is_nearer(self, mean: Array, spread: Array, t: float) -> bool:
        """True where a mean innovation of some ``spread``, its variances, tells that a channel is right from that it
        is as far off as at first.
        """
        if self._first is None or (self._out != self._position and t - self._left >= LATCHED):
            return True
        first, variance = self._first
        rival = float((np.square(mean - first) / (spread + variance)).sum())
        return rival - float((np.square(mean) / spread).sum()) >= _NEARER

    def _may_be_late(self, D: Array, variance: Array, x: Array) -> bool:
        """True for a leap D of a position with some ``variance`` that is against the velocity at x (n,)."""
        axes = [("x_e", "y_e", "z_e").index(self._coordinates.states[k]) for k in self._rows[self._position]]
        v = self._coordinates.velocity(x[: len(self._R)])[axes]
        unsure, speed, length = _RECENT * math.sqrt(variance.max()), float(np.linalg.norm(v)), float(np.linalg.norm(D))
        tau = -float(D @ v) / max(speed, 1e-9) ** 2
        return tau * speed > unsure and float(np.linalg.norm(D + tau * v)) <= max(unsure, _ASIDE * length)

    def _again(self) -> tuple[Array, Array, Array]:
        """G (c,) of the channels, and delta (c, n) and Delta (c, n, n) of each after the last reading."""
        c, m, n = len(self._rows), len(self._R), len(self._readings[0].before)
        delta, Delta = np.zeros((c, n)), np.zeros((c, n, n))
        squares = np.empty((len(self._readings), c + 1))
        for k, each in enumerate(self._readings):
            delta, Delta = delta @ each.Phi.T, each.Phi @ Delta @ each.Phi.T
            P, nu = each.P_before + Delta, each.nu - delta[:, :m]
            solved = np.linalg.solve(
                P[:, :m, :m] + self._without, np.concatenate([P[:, :m, :], nu[:, :, None]], axis=2)
            )  # (c, m, n + 1), S^-1 (H P, nu)
            gain = np.swapaxes(solved[:, :, :n], 1, 2)
            squares[k, 0] = each.nu @ np.linalg.solve(each.P_before[:m, :m] + self._R, each.nu)
            squares[k, 1:] = (nu * solved[:, :, n]).sum(axis=1)
            x, P = each.before + delta + (gain @ nu[:, :, None])[:, :, 0], P - gain @ P[:, :m, :]
            P = 0.5 * (P + np.swapaxes(P, 1, 2))
            delta, Delta = x - each.after, P - each.P_after
        squares = np.minimum(squares, self._clip)
        larger = np.maximum(squares[:, 1:].mean(axis=0) / (m - self._sizes), 1.0)
        explained = (squares[:, :1] - squares[:, 1:]) / larger - self._sizes
        return np.cumsum(explained[::-1], axis=0).max(axis=0), delta, Delta
