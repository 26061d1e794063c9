"""Confirmation of a pose that was found: the readings of the last seconds, replayed, must say the same by themselves.

A search for the pose may end at a wrong one, for the truth need not be near any hypothesis, and a Kalman filter there
follows the readings for some time. So what it finds counts as known once a replay over the readings since then
(``replay_kernels``) confirms it: they determine the pose, it is theirs within the errors of both, and no more of them
contradict it than outliers would.

One reading of fewer than three rays does not determine a pose. With them slip that was found explains nothing, and as
other poses may fit the way as well, these are sought: poses anywhere, projected onto the feasible set of the newest
reading, are fitted to the way to it. While one is found that is apart, the pose is not known.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.ranging.bank_kernels import GRIP, Hypotheses, Symmetry, square_apart
from mathnavi.estimators.ranging.feasible_set_kernels import farthest_points, project, pushed
from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.model import STATES, RangeModel
from mathnavi.estimators.ranging.replay_kernels import refit, replay
from mathnavi.interfaces.signals import Array

_MOST = 2.0  # [s] that are replayed
_LEAST = 1.0  # [s] that a pose is confirmed by at least
_READINGS = 10  # that are kept, however seldom they come
_DETERMINED = 0.3  # [m, rad] greatest standard deviation of a pose that the replayed readings determine
_AGREES = float(chdtri(3, 1e-3))  # d' S^-1 d of two estimates of the same pose at most
_CONTRADICT = 1.0 / 3.0  # share of rays that may be beyond the gate, where outliers are not more frequent
_MORE = 1.5  # times the share of outliers that may occur by chance
_BY_THEMSELVES = 3  # rays that determine a pose without odometry
_DRAWN, _SEED, _PROJECTIONS = 300, 0, 3  # poses that are projected onto the feasible set
_FITTED, _NEAREST = 48, 0.1  # of them, that are fitted, and how far apart they are [m, rad] at least
_SOME = 12  # readings that they are fitted to
_FITS = 1e-3  # probability that the true pose is not found to fit
_SAME = 0.3**2 * np.eye(3)  # [m^2, rad^2] within which a pose is the same
_NONE = np.empty((0, STATES))
_TRIES = 10  # a window, so that most readings are not replayed


class Confirmation:
    """Whether the best hypothesis is confirmed; it begins again with each search."""

    def __init__(self, model: RangeModel, period: float, symmetry: Symmetry, *, is_known: bool) -> None:
        """``period`` [s] is that between two calls; nothing has to be confirmed of a start that ``is_known``."""
        count = max(math.ceil(_MOST / period), _READINGS)
        self._model, self._symmetry = model, symmetry
        self._anywhere = model.anywhere(np.random.default_rng(_SEED), _DRAWN)
        self._ranges, self._inputs = np.full((count, len(model.angles)), np.nan), np.zeros((count, 2))
        self._times = np.full(count, np.nan)  # [s]
        self._kept = 0  # calls since the search, with the readings that it rests on
        self._due = 0  # calls until the next try
        self.is_confirmed = is_known
        self.others = _NONE
        """poses (m, 4) that fit the readings as well as the best hypothesis"""
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
        """Begin again: a search that rests on the last ``calls`` has made new hypotheses."""
        self._kept = min(calls, len(self._times))
        self.change()

    def change(self) -> None:
        """Another hypothesis is the best one."""
        self._due, self.is_confirmed, self.is_refuted, self.others = 0, False, False, _NONE

    def confirms(
        self, bank: Hypotheses, best: int, P: Array, sensors: RaySensors, misfit: float, correlated: float
    ) -> bool:
        """True once a replay has confirmed the ``best`` hypothesis of the bank, whose pose has the covariance P (3, 3).

        ``sensors`` have the noise that was found; ``misfit`` is the greatest mean of NIS that fits, ``correlated`` the
        variance of a mean of correlated errors over that of independent ones, with which P has been multiplied.
        """
        self.others = _NONE
        if self.is_confirmed or self._due > 0:
            return self.is_confirmed
        n = self._kept
        times = self._times[-n:]
        few = np.isfinite(self._ranges[-n:]).any(axis=0).sum() < _BY_THEMSELVES
        if n < 2 or times[-1] - times[0] < _LEAST:
            return False
        self._due = max(1, n // _TRIES)
        slip = max(float(bank.slip[best]) - GRIP, 0.0)
        slip = min(slip, GRIP) if few else slip
        way = self._ranges[-n:], self._inputs[-n:], times, self._model.wall
        errors = self._model.W, float(bank.P[best, 3, 3]), slip
        rays, beyond, nis, d, C = replay(bank.x[best], *way, sensors, *errors)
        C *= correlated
        determined = max(math.sqrt(np.linalg.eigvalsh(C[:2, :2])[-1]), math.sqrt(C[2, 2])) <= _DETERMINED
        agrees = bool(
            beyond <= max(_CONTRADICT, _MORE * sensors.outliers) * rays
            and nis <= misfit * (rays - beyond)
            and d @ np.linalg.solve(C + P, d) <= _AGREES
        )
        self.is_refuted = bool(few and not agrees)
        if few and determined:
            self.others = self._others(bank, best, n, sensors, errors)
        self.is_confirmed = determined and agrees and rays > 0 and len(self.others) == 0
        return self.is_confirmed

    def _others(
        self, bank: Hypotheses, best: int, n: int, sensors: RaySensors, errors: tuple[Array, float, float]
    ) -> Array:
        """Poses (m, 4) apart from the ``best`` hypothesis, and from each other, that the last n readings fit as well.

        Poses anywhere are projected onto the feasible set of the newest reading, and those that are farthest from each
        other are fitted to some of the readings.
        """
        model, wall = self._model, self._model.wall
        ranges, inputs, times = self._ranges[-n:].copy(), self._inputs[-n:], self._times[-n:]
        read = np.isfinite(ranges).sum(axis=1)
        newest = int(np.flatnonzero(read == read.max())[-1])  # of those with most rays
        y = ranges[newest]
        states, far = project(self._anywhere, y, model.range_variance(y), wall, model.angles, _PROJECTIONS, math.inf)
        left = self._inputs[len(self._inputs) - n + newest + 1 :]
        states = states[np.isfinite(far)]
        if not len(states):
            return _NONE
        if len(left):
            states = pushed(states, left, wall, float(times[-1] - times[newest]) / len(left), 1.0)
        states = states[farthest_points(states, 0, min(_FITTED, len(states)), _NEAREST)]
        states[:, 3] = bank.x[best, 3]
        some = np.flatnonzero(read)[::-1][:: max(1, np.count_nonzero(read) // _SOME)]
        ranges[np.setdiff1d(np.arange(n), some)] = np.nan
        nis = refit(states, ranges, inputs, times, wall, sensors, *errors)
        rays = np.isfinite(ranges).sum()
        states = states[nis * rays <= chdtri(rays, _FITS)]
        found: list[Array] = []
        for x in states:
            known = [bank.x[best], *found]
            if all(square_apart(x, each, _SAME, self._symmetry) > 1.0 for each in known):
                found.append(x)
        return np.array(found) if found else _NONE
