"""Witness of a flight by ranges to beacons: tests of what its filter publishes, against the readings.

The channels are the beacons, and where fixes are read, the three numbers of a fix. Readings are predicted from the
published estimate before them, by the input and the published gust, so that those of a channel that is left out are
tested too.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.integrity.windows import CLIP, IMPOSSIBLE, QUIET, Flags, Thresholds, Windows, Worst
from mathnavi.estimators.integrity.witness import is_plausible
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.aerial.beacons import RANGES, FlightBeacons, curvature_effects, slant_ranges
from mathnavi.models.aerial.mission import FlightMission

_WINDOWS = (0.5, 2.0, 5.0)  # [s]
_REPEATS, _MOVED = 3, 6.0  # repeated readings, and deviations that the prediction has moved meanwhile: stuck
_ALIKE = float(chdtri(6, 1e-3))
FIXES = "position"
"""name of the sensor of fixes"""


class RangeWitness:
    """Tests of (x, P) (6,) against the ranges and the fixes of a flight."""

    rebuilt: frozenset[int] = frozenset()
    suspicious = doubtful = False  # the estimator puts nothing down to anything else

    def __init__(self, beacons: FlightBeacons, mission: FlightMission, config: KalmanConfig) -> None:
        n = len(beacons.places)
        self._places = beacons.array
        axes = tuple(f"fix {axis}" for axis in "xyz") if config.fixes else ()
        self.names, self.strict = (*beacons.names(), *axes), False
        self._R = np.array([max(beacons.noise, config.noise_floor) ** 2] * n)
        self._R = np.append(self._R, [max(mission.position_noise, config.noise_floor) ** 2] * len(axes))
        self._gust = mission.gust.rms**2
        m = beacons.outliers
        thresholds = Thresholds.of(len(self.names), mission.control_period, _WINDOWS)
        self.windows = Windows(thresholds, len(self.names), 1.0 - m + m * CLIP**2)
        self._nothing = np.full(len(self.names), np.nan)
        self._last, self._first, self._moved = (self._nothing.copy() for _ in range(3))
        self._repeats, self._most = np.zeros(len(self.names), dtype=np.int64), 0
        self._worst = QUIET
        self._level = np.full(1, np.nan)

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        if not is_plausible(after):
            self._worst = Worst(math.inf, IMPOSSIBLE, -1)
            return self._worst
        known = before is not None and before.covariance is not None and after.t > before.t
        y, t = self._newest(measurements) if known else (self._nothing, after.t)
        read = np.isfinite(y)
        if not known or not read.any():
            self.windows.add(self._nothing, self._nothing)
            return self._worst
        assert before is not None
        expected, S = self._predicted(before, t, command)
        nu = y - expected
        e = nu / np.sqrt(S.diagonal())
        white = self._nothing.copy()
        rows = np.flatnonzero(read & used)
        if len(rows):
            white[rows] = np.linalg.solve(np.linalg.cholesky(S[np.ix_(rows, rows)]), nu[rows])
        self.windows.add(np.where(read, e, np.nan), white)
        self._note_repeats(y, expected, read)
        self._worst = self.windows.worst(used)
        return self._worst

    def _predicted(self, before: Estimate, t: float, command: Array) -> tuple[Array, Array]:
        """Expected readings (l,) at t [s] and their covariance (l, l)."""
        P = before.covariance
        assert P is not None
        h, n = t - before.t, len(self._places)
        p = before.x[:3] + h * before.x[3:] + 0.5 * h * h * (command + before.extra["gust"])
        C = P[:3, :3] + h * (P[:3, 3:] + P[3:, :3]) + h * h * P[3:, 3:] + 0.25 * h**4 * self._gust * np.eye(3)
        ranges, H = slant_ranges(self._places, p)
        means, R = np.empty(n), self._R.copy()
        for i, u in enumerate(H):
            means[i], variance = curvature_effects(C, u, max(ranges[i], 1e-6))
            R[i] += variance
        expected = ranges + means
        if len(self.names) > n:
            expected, H = np.append(expected, p), np.vstack([H, np.eye(3)])
        return expected, H @ C @ H.T + np.diag(R)

    def _newest(self, measurements: Sequence[Measurement]) -> tuple[Array, float]:
        """Newest readings (l,), NaN for none, and their time [s]: of the newest instant alone."""
        mine = [each for each in measurements if each.name in (RANGES, FIXES)]
        n, y = len(self._places), self._nothing.copy()
        t = max((each.t for each in mine), default=0.0)
        for each in mine:
            if each.t < t:
                continue
            if each.name == RANGES and each.value.shape == (n,):
                y[:n] = np.where(np.isfinite(each.value), each.value, np.nan)
            elif each.name == FIXES and len(y) > n and each.value.shape == (3,):
                y[n:] = np.where(np.isfinite(each.value), each.value, np.nan)
        return y, t

    def _note_repeats(self, y: Array, expected: Array, read: Flags) -> None:
        same = read & (y == self._last)
        self._repeats = np.where(same, self._repeats + 1, np.where(read, 0, self._repeats))
        self._most = int(self._repeats.max())
        self._first = np.where(read & ~same, expected, self._first)
        self._moved = np.where(read, expected, self._moved)
        self._last = np.where(read, y, self._last)

    @property
    def protection(self) -> Array:
        """Not known."""
        return self._level

    def stuck(self) -> list[int]:
        if self._most < _REPEATS:
            return []
        moved = np.abs(self._moved - self._first) > _MOVED * np.sqrt(self._R)
        return np.flatnonzero((self._repeats >= _REPEATS) & moved).tolist()

    def against(self, channel: int) -> float:
        return self.windows.of_channel(channel)

    def is_quiet(self, channel: int, updates: int) -> bool:
        return self.windows.is_quiet(channel, updates)

    def forget(self, channel: int) -> None:
        self.windows.forget(channel)

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        n = len(self._places)
        rows = {RANGES: [i for i in out if i < n], FIXES: [i - n for i in out if i >= n]}
        return tuple(_without(each, rows[each.name]) if rows.get(each.name) else each for each in measurements)

    def agree(self, one: Estimate, other: Estimate) -> bool:
        assert one.covariance is not None
        assert other.covariance is not None
        d = one.x - other.x
        return float(d @ np.linalg.solve(one.covariance + other.covariance, d)) < _ALIKE

    def clear(self) -> None:
        self.windows.clear()
        self._worst = QUIET

    def copy(self) -> RangeWitness:
        made = copy.copy(self)
        made.windows = self.windows.copy()
        return made


def _without(reading: Measurement, rows: list[int]) -> Measurement:
    value = np.array(reading.value, np.float64)
    if value.shape[0] > max(rows):
        value[rows] = np.nan
    return dataclasses.replace(reading, value=value)
