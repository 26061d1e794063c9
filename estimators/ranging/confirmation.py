"""Confirmation of a pose that was found: the readings of the last seconds, replayed, must say the same by themselves.

A search for the pose may end at a wrong one, for the truth need not be near any hypothesis, and a Kalman filter there
follows the readings for some time. So what it finds counts as known once a replay over the readings since then
(``replay_kernels``) confirms it: they determine the pose, it is theirs within the errors of both, and no more of them
contradict it than outliers would. Fewer than three rays do not determine a pose without odometry: with them slip that
was found is no explanation.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.ranging.bank_kernels import GRIP, Hypotheses
from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.replay_kernels import replay
from mathnavi.interfaces.signals import Array

_MOST = 3.0  # [s] that are replayed
_LEAST, _LEAST_OF_FEW = 1.0, 2.0  # [s] that a pose is confirmed by at least; by fewer rays than determine one
_READINGS = 10  # that are kept, however seldom they come
_DETERMINED = 0.3  # [m, rad] greatest standard deviation of a pose that the replayed readings determine
_AGREES = float(chdtri(3, 1e-3))  # d' S^-1 d of two estimates of the same pose at most
_CONTRADICT = 1.0 / 3.0  # share of rays that may be beyond the gate, where outliers are not more frequent
_MORE = 1.5  # times the share of outliers that may occur by chance
_BY_THEMSELVES = 3  # rays that determine a pose without odometry
_TRIES = 10  # a window, so that most readings are not replayed


class Confirmation:
    """Whether the best hypothesis is confirmed; it begins anew with each search."""

    def __init__(self, model: RangeModel, period: float, *, is_known: bool) -> None:
        """``period`` [s] is that between two calls; nothing has to be confirmed of a start that ``is_known``."""
        count = max(math.ceil(_MOST / period), _READINGS)
        self._model = model
        self._ranges, self._inputs = np.full((count, len(model.angles)), np.nan), np.zeros((count, 2))
        self._times = np.full(count, np.nan)  # [s]
        self._kept = 0  # calls since the search, with the readings that it rests on
        self._due = 0  # calls until the next try
        self.is_confirmed = is_known
        self.is_refuted = False
        """True if it is contradicted, and rays that do not determine a pose themselves will not lead it to the truth"""

    def remember(self, t: float, rho: Array, u: Array) -> None:
        """Remember the ranges rho (l,) [m] of t [s], NaN where lost, and the input u (2,) since the call before."""
        for values, newest in ((self._ranges, rho), (self._inputs, u), (self._times, t)):
            values[:-1] = values[1:]
            values[-1] = newest
        self._kept = min(self._kept + 1, len(self._times))
        self._due -= 1

    def begin(self, calls: int) -> None:
        """Begin anew: a search that rests on the last ``calls`` has made new hypotheses."""
        self._kept, self._due, self.is_confirmed = min(calls, len(self._times)), 0, False
        self.is_refuted = False

    def change(self) -> None:
        """Another hypothesis is the best one."""
        self._due, self.is_confirmed = 0, False
        self.is_refuted = False

    def confirms(
        self, bank: Hypotheses, best: int, P: Array, sensors: RaySensors, misfit: float, correlated: float
    ) -> bool:
        """True once a replay has confirmed the ``best`` hypothesis of the bank, whose pose has the covariance P (3, 3).

        ``sensors`` have the noise that was found; ``misfit`` is the greatest mean of NIS that fits, ``correlated`` the
        variance of a mean of correlated errors over that of independent ones, with which P has been multiplied.
        """
        if self.is_confirmed or self._due > 0:
            return self.is_confirmed
        n = self._kept
        times = self._times[-n:]
        few = len(sensors.angles) < _BY_THEMSELVES
        if n < 2 or times[-1] - times[0] < (_LEAST_OF_FEW if few else _LEAST):
            return False
        self._due = max(1, n // _TRIES)
        x, slip = bank.x[best], max(float(bank.slip[best]) - GRIP, 0.0)
        if few:
            slip = min(slip, GRIP)
        rays, beyond, nis, d, C = replay(
            x,
            self._ranges[-n:],
            self._inputs[-n:],
            times,
            self._model.wall,
            sensors,
            self._model.W,
            float(bank.P[best, 3, 3]),
            slip,
        )
        C *= correlated
        determined = max(math.sqrt(np.linalg.eigvalsh(C[:2, :2])[-1]), math.sqrt(C[2, 2])) <= _DETERMINED
        agrees = bool(
            beyond <= max(_CONTRADICT, _MORE * sensors.outliers) * rays
            and nis <= misfit * (rays - beyond)
            and d @ np.linalg.solve(C + P, d) <= _AGREES
        )
        self.is_confirmed = determined and agrees and rays > 0
        self.is_refuted = few and not agrees
        return self.is_confirmed
