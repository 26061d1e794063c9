"""Witness of a flight among beacons: tests of what its filter publishes, against the readings.

The channels are the beacons, and where fixes are read, the three numbers of a fix. Each number that is read is tested
by itself, and the worst of a beacon is that of its channel: a beacon is left out with all that is read of it. Without
beacon 0 the differences go on without their reference: the noise of the arrival from it is anything. Readings are
predicted from the published estimate before them, by the input and the published gust, so that those of a channel that
is left out are tested too.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.integrity.number_tests import NumberTests
from mathnavi.estimators.integrity.windows import IMPOSSIBLE, Flags, Worst
from mathnavi.estimators.integrity.witness import is_plausible
from mathnavi.interfaces.signals import Array, Estimate, Integers, Measurement
from mathnavi.models.aerial.beacon_readings import AZIMUTH, DIFFERENCE, LEAST_ANGLE, BeaconRows, curvature_effects
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.angles import wrapped
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES

_WINDOWS = (0.5, 2.0, 5.0)  # [s]
_ALIKE = float(chdtri(6, 1e-3))
FIXES = "position"
"""name of the sensor of fixes"""


UNREFERENCED = "beacon_differences without beacon 0"
"""name of a reading of differences whose arrival from beacon 0 is not to be trusted; only a witness gives it"""
UNTRUSTED = 1e10  # [m^2] variance of that arrival


class BeaconWitness(NumberTests):
    """Tests of (x, P) (6,) against the readings of beacons and the fixes of a flight."""

    def __init__(self, beacons: FlightBeacons, mission: FlightMission, config: KalmanConfig) -> None:
        n = len(beacons.places)
        self.rows = rows = BeaconRows(beacons, config.noise_floor, LEAST_ANGLE)
        """rows that the beacons' readings give"""
        axes = tuple(f"fix {axis}" for axis in "xyz") if config.fixes else ()
        self.levels = ("protection, position [m]", "protection, velocity [m/s]")
        self.names = (*beacons.names(), *axes)
        self._size = rows.size + len(axes)
        channels = np.append(rows.beacons, n + np.arange(len(axes)))
        fixed = np.eye(len(axes)) * max(mission.position_noise, config.noise_floor) ** 2
        self._R = block_diag(rows.covariance(np.arange(rows.size)), fixed)
        self._gust = mission.gust.rms**2
        super().__init__(
            channels, np.sqrt(self._R.diagonal()), mission.control_period, 1.0 / beacons.rate, _WINDOWS,
            beacons.outliers,
        )  # fmt: skip

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        if not is_plausible(after):
            self._worst = Worst(math.inf, IMPOSSIBLE, -1)
            return self._worst
        self._level = after.extra["protection"].copy()
        known = before is not None and before.covariance is not None and after.t > before.t
        y, t = self._newest(measurements) if known else (self._nothing, after.t)
        read = np.isfinite(y)
        if not known or not read.any():
            self.add(self._nothing, self._nothing)
            return self._worst
        assert before is not None
        relied = used[self._channel]
        expected, S = self._predicted(before, t, command)
        nu = y - expected
        turned = np.flatnonzero(self.rows.kinds == AZIMUTH)
        nu[turned] = wrapped(nu[turned])
        e = np.where(read, nu / np.sqrt(S.diagonal()), np.nan)
        shared = np.flatnonzero(self.rows.kinds == DIFFERENCE)
        if len(shared):
            kept = shared[(read & relied)[shared]]
            S = self._test_arrival(e, nu, S, shared, kept, trusted=bool(used[0]))
        white = self._nothing.copy()
        rows = np.flatnonzero(read & relied)
        if len(rows):
            white[rows] = np.linalg.solve(np.linalg.cholesky(S[np.ix_(rows, rows)]), nu[rows])
        self.add(e, white)
        self.note_repeats(y, expected, read)
        return self.worst_of(relied)

    def _test_arrival(self, e: Array, nu: Array, S: Array, shared: Integers, kept: Integers, *, trusted: bool) -> Array:
        """Test the arrival from beacon 0, which the rows ``shared`` have in common, by the mean of those that are
        ``kept``: its normalised innovation takes the place in ``e`` of the difference of beacon 0 to itself.

        Where it is not ``trusted``, the others are tested by what they differ from that mean. Returns the covariance
        of all innovations.
        """
        if not len(kept):
            if not trusted:
                e[shared] = np.nan
            return S
        within = S[np.ix_(kept, kept)]
        weights = np.linalg.inv(within).sum(axis=0)
        weights /= weights.sum()
        arrival, variance = float(weights @ nu[kept]), float(weights @ within @ weights)
        e[shared[0]] = arrival / math.sqrt(variance)
        if trusted:
            return S
        spread = S.diagonal()[shared] - 2.0 * S[np.ix_(shared, kept)] @ weights + variance
        least = self.rows.variance[shared] / len(kept)  # rounding
        e[shared[1:]] = ((nu[shared] - arrival) / np.sqrt(np.maximum(spread, least)))[1:]
        S = S.copy()
        S[np.ix_(shared, shared)] += UNTRUSTED
        return S

    def _predicted(self, before: Estimate, t: float, command: Array) -> tuple[Array, Array]:
        """Expected numbers (size,) at t [s] and their covariance (size, size)."""
        P = before.covariance
        assert P is not None
        h, m = t - before.t, self.rows.size
        p = before.x[:3] + h * before.x[3:] + 0.5 * h * h * (command + before.extra["gust"])
        C = P[:3, :3] + h * (P[:3, 3:] + P[3:, :3]) + h * h * P[3:, 3:] + 0.25 * h**4 * self._gust * np.eye(3)
        expected, H, R = np.empty(self._size), np.empty((self._size, 3)), self._R.copy()
        for k in range(m):
            number, H[k], D = self.rows.at(k, p)
            mean, variance = curvature_effects(C, D)
            expected[k] = number + mean
            R[k, k] += variance
        expected[m:], H[m:] = p[: self._size - m], np.eye(3)[: self._size - m]
        return expected, H @ C @ H.T + R

    def _newest(self, measurements: Sequence[Measurement]) -> tuple[Array, float]:
        """Newest readings (size,), NaN for none, and their time [s]: of the newest instant alone."""
        places = {**self.rows.slices, FIXES: slice(self.rows.size, self._size)}
        mine = [each for each in measurements if each.name in places]
        y = self._nothing.copy()
        t = max((each.t for each in mine), default=0.0)
        for each in mine:
            own = places[each.name]
            if each.t >= t and each.value.shape == (own.stop - own.start,):
                y[own] = np.where(np.isfinite(each.value), each.value, np.nan)
        return y, t

    def read(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Array | None:
        """Newest readings (m,) of the beacons but those that are left ``out``, NaN for none; None if there are none."""
        y = self._newest(measurements)[0][: self.rows.size].copy()
        y[np.isin(self.rows.beacons, list(out))] = np.nan
        return y if np.isfinite(y).any() else None

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        n = len(self.rows.places)
        beacons, fixed = [i for i in out if i < n], [i - n for i in out if i >= n]
        return tuple(self._without(each, beacons, fixed) for each in measurements)

    def _without(self, reading: Measurement, beacons: list[int], fixed: list[int]) -> Measurement:
        n = len(self.rows.places)
        numbers = fixed if reading.name == FIXES else beacons
        if reading.name == BEARINGS:
            numbers = [*beacons, *(n + i for i in beacons)]
        if not numbers or reading.name not in (FIXES, *self.rows.slices):
            return reading
        value = np.array(reading.value, np.float64)
        if value.shape[0] > max(numbers):
            value[numbers] = np.nan
        name = UNREFERENCED if reading.name == DIFFERENCES and 0 in beacons else reading.name
        return dataclasses.replace(reading, name=name, value=value)

    def agree(self, one: Estimate, other: Estimate) -> bool:
        assert one.covariance is not None
        assert other.covariance is not None
        d = one.x - other.x
        return float(d @ np.linalg.solve(one.covariance + other.covariance, d)) < _ALIKE
