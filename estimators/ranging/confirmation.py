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
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.ranging.bank_kernels import GRIP, Hypotheses, Symmetry, square_apart
from mathnavi.estimators.ranging.feasible_set_kernels import farthest_points, project, pushed
from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.last_readings import LastReadings, Way
from mathnavi.estimators.ranging.model import STATES, RangeModel
from mathnavi.estimators.ranging.replay_kernels import Reckoning, refit, replay
from mathnavi.interfaces.signals import Array

_LEAST, _MOST, _TIMEOUTS = 1.0, 2.0, 4.0  # [s] that are replayed: at least, at most, or timeouts if these are longer
_TRIES = 10  # while that time passes: most readings are not replayed
_DETERMINED = 0.3  # [m, rad] greatest standard deviation of a pose that readings determine, if one is as exact
_AGREES = float(chdtri(3, 1e-3))  # d' S^-1 d of two estimates of the same pose at most
_CONTRADICT = 1.0 / 3.0  # share of rays that may be beyond the gate, where outliers are not more frequent
_MORE = 1.5  # times the share of outliers that may occur by chance
_BY_THEMSELVES = 3  # rays that determine a pose without odometry
_PROJECTIONS, _FITTED, _NEAREST = 3, 48, 0.1  # steps; poses that are fitted, and how far apart [m, rad] at least
_SOME = 8  # readings that they are fitted to
_FITS = 1e-3  # probability that the true pose is not found to fit
_SAME = 0.3**2 * np.eye(3)  # [m^2, rad^2] within which a pose is the same


class Others(NamedTuple):
    """Poses that fit the readings as well as the best hypothesis."""

    states: Array  # (m, 4)
    covariances: Array  # (m, 3, 3)


_NONE = Others(np.empty((0, STATES)), np.empty((0, 3, 3)))


def replayed_calls(period: float, timeout: float) -> int:
    """Number of calls that are replayed at most: as ranges may be read seldom, of some of their timeouts [s]."""
    return math.ceil(max(_MOST, _TIMEOUTS * timeout) / period)


class Confirmation:
    """Whether the best hypothesis is confirmed; it begins again with each search."""

    def __init__(
        self, model: RangeModel, last: LastReadings, candidates: Array, symmetry: Symmetry, *, is_known: bool
    ) -> None:
        """``last`` are the readings, which others write. Other poses are sought from ``candidates`` (n, 4). Nothing has
        to be confirmed of a start that ``is_known``.
        """
        self._model, self._last, self._candidates, self._symmetry = model, last, candidates, symmetry
        self._since = 0  # the call from which on readings count
        self._due = 0  # the call of the next try
        self.is_confirmed = is_known
        self.is_refuted = False
        """True if it is contradicted, and rays that do not determine a pose themselves will not lead it to the truth"""

    def begin(self, calls: int) -> None:
        """Begin again: a search that rests on the last ``calls`` has made new hypotheses."""
        self._since = self._last.calls - calls
        self.change()

    def change(self) -> None:
        """Another hypothesis is the best one."""
        self._due, self.is_confirmed, self.is_refuted = 0, False, False

    def attempt(
        self, bank: Hypotheses, best: int, P: Array, sensors: RaySensors, misfit: float, correlated: float
    ) -> Others:
        """Try to confirm the ``best`` hypothesis of the bank, whose pose has the covariance P (3, 3), if it is time to.

        ``sensors`` have the noise that was found; ``misfit`` is the greatest mean of NIS that fits, ``correlated`` the
        variance of a mean of correlated errors over that of independent ones, with which P has been multiplied. Returns
        the poses that keep it from being confirmed, for they fit the readings too.
        """
        if self.is_confirmed or self._last.calls < self._due:
            return _NONE
        way = self._last.last(self._last.calls - self._since)
        if not way.times[-1] - way.times[0] >= _LEAST:
            return _NONE
        self._due = self._last.calls + max(1, len(way.times) // _TRIES)
        few = np.isfinite(way.ranges).any(axis=0).sum() < _BY_THEMSELVES
        slip = max(float(bank.slip[best]) - GRIP, 0.0)
        reckoning = Reckoning(self._model.W, float(bank.P[best, 3, 3]), min(slip, GRIP) if few else slip)
        fit = replay(bank.x[best], way, self._model.wall, sensors, reckoning)
        if not fit.rays:
            return _NONE
        C = correlated * fit.P
        coarse = max(_DETERMINED, math.sqrt(np.nanmax(self._model.range_variance(way.ranges))))
        determined = np.linalg.eigvalsh(C[:2, :2])[-1] <= coarse**2 and C[2, 2] <= _DETERMINED**2
        agrees = bool(
            fit.beyond <= max(_CONTRADICT, _MORE * sensors.outliers) * fit.rays
            and fit.nis <= misfit * (fit.rays - fit.beyond)
            and fit.d @ np.linalg.solve(C + P, fit.d) <= _AGREES
        )
        self.is_refuted = bool(few and not agrees)
        others = self._others(bank.x[best], way, sensors, reckoning) if few and determined else _NONE
        self.is_confirmed = bool(determined and agrees and not len(others.states))
        return others

    def _others(self, x: Array, way: Way, sensors: RaySensors, reckoning: Reckoning) -> Others:
        """Poses apart from x (4,) under the symmetry, and from each other, that fit the readings on the way to them.

        The candidates are projected onto the feasible set of the newest reading, and those that are farthest from each
        other are fitted to some of the readings.
        """
        model, wall, ranges = self._model, self._model.wall, way.ranges.copy()
        read = np.isfinite(ranges).sum(axis=1)
        newest = int(np.flatnonzero(read == read.max())[-1])  # of those with most rays
        y, left = ranges[newest], way.inputs[newest + 1 :]
        states, far = project(self._candidates, y, model.range_variance(y), wall, model.rays, _PROJECTIONS, math.inf)
        states = states[np.isfinite(far)]
        if not len(states):
            return _NONE
        if len(left):
            states = pushed(states, left, wall, float(way.times[-1] - way.times[newest]) / len(left), 1.0)
        states = states[farthest_points(states, 0, min(_FITTED, len(states)), _NEAREST)]
        states[:, 3] = x[3]
        some = np.flatnonzero(read)[::-1][:: max(1, np.count_nonzero(read) // _SOME)]
        ranges[np.setdiff1d(np.arange(len(ranges)), some)] = np.nan
        nis, covariances = refit(states, way._replace(ranges=ranges), wall, sensors, reckoning)
        found: list[int] = []
        for k in np.flatnonzero(nis <= chdtri(np.isfinite(ranges).sum(), _FITS)):
            known = [x, *(states[j] for j in found)]
            if all(square_apart(states[k], each, _SAME + covariances[k], self._symmetry) > 1.0 for each in known):
                found.append(int(k))
        return Others(states[found], covariances[found])
