"""Solution separation: filters without a beacon each, and one that trusts odometry less, beside the filter of all.

If only beacon i is at fault, the filter without it knows nothing of that: its error is as its covariance P_i says,
whatever the fault is and since when. With x_0, P_0 of all readings, and d_i = x_i - x_0 of the poses, it follows that

    |error of x_0| <= |d_i| + 3 sqrt(lambda_max(P_i)),

but for what three deviations leave out; the largest of these over all i is the protection level. Without a fault both
are estimates of the same, the one from more, so that cov(d_i) = P_i - P_0: d_i is tested by chi-square. [R. G. Brown,
P. W. McBurney, Self-contained GPS integrity check using maximum solution separation, Navigation 35, 1988]

The scale errors of odometry of the last filter change, as ``mistrust`` says: it is right while wheels slip. Where its
separation is the largest, and beyond chance, the filter of all goes on from it and mistrusts the odometry too, and so
do those without a beacon. The last one trusts it then, from x_0 and scale errors as declared on. Where it was not
separate for ``lasts`` seconds, and its scale errors stayed as declared, twice in sequence, all go on from it: in a part
of the first the odometry may yet have been wrong. One that refuses many readings in sequence has lost its way, and
begins at x_0, and so do all in the first ten seconds while the heading is not known to a tenth of a radian: they
linearise at different poses, and would differ for that alone. The level says nothing of a fault from before a filter
has begun: it is part of the state then.
"""

from __future__ import annotations

import copy
import math
from typing import Self

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.beacons.kernels import condition, predict, separations
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.interfaces.signals import Array

_SCALE, _CHANGES = 0.2, 5.0  # [-], [s]
ODOMETRY_SCALES = slice(3, 5)
"""scale errors of the odometry in a state"""
_DEVIATIONS = 3.0
WRONG, _ALIKE = float(chdtri(3, 1e-4)), float(chdtri(3, 1e-3))  # squares: of odometry that is wrong, or right again
_USUAL = float(chdtri(2, 0.05))  # square of scale errors as they are declared
_TWICE, _READINGS = 2, 3
_SEQUENCE, _DOUBTFUL = 8, 0.5  # readings that a filter refuses in sequence, by the probability that each is none
_LEAST_VARIANCE = 1e-8
_TURNED, _SETTLING = 0.1, 10.0  # [rad] of a heading, beyond which filters that linearise elsewhere differ; [s] at most
_LEAST = 0.1  # of the covariance of all readings: the least variance of a separation, for filters linearise


def mistrust(x: Array, P: Array, h: float) -> None:
    """Let the scale errors of odometry in states x (N, d), P (N, d, d) change for h [s], in place.

    They are Ornstein-Uhlenbeck processes of the deviation ``_SCALE``, of which e^-1 is left after ``_CHANGES``.
    """
    kept = math.exp(-h / _CHANGES)
    x[:, ODOMETRY_SCALES] *= kept
    P[:, ODOMETRY_SCALES, :] *= kept
    P[:, :, ODOMETRY_SCALES] *= kept
    for k in (3, 4):
        P[:, k, k] += (1.0 - kept * kept) * _SCALE**2


class SolutionSeparation:
    """Filters at x (n + 1, d) with P (n + 1, d, d): without beacon i = 0 ... n - 1, and with other odometry."""

    def __init__(self, model: BeaconModel, gate: float, lasts: float) -> None:
        """``gate`` is the nu^2 / s at which a filter rejects a reading; odometry is tested for ``lasts`` [s] each."""
        self._model, self._lasts = model, lasts
        self._errors = {kind: np.append(errors, gate) for kind, errors in model.errors.items()}
        count = len(model.places) + 1
        self._beacons = np.arange(count)
        self._declared = np.maximum(np.square(model.scales[:2]), _LEAST_VARIANCE)
        self._x, self._P = np.empty((count, 0)), np.empty((count, 0, 0))
        self.mistrusts = False
        """whether the filter of all is to mistrust the odometry"""
        self._unsettled = 0.0  # [s] for which all begin again while the heading is not known
        self._left, self._largest = 0.0, 0.0  # [s] for which the last one is tested, and its largest separation so far
        self._passed = 0  # such times in sequence that it has passed
        self._levels = np.full((count, 2), np.nan)
        self.squares, self.level = np.full(count, np.nan), np.full(2, np.nan)
        """the median d_i' cov(d_i)^-1 d_i (n + 1,) of the last three readings, for one may be large where two
        poses are nearly the same, and the protection level (2,) [m, rad], of the last pose that was judged"""
        self._refused = np.zeros(count, dtype=np.int64)  # readings in sequence that each has refused
        self._recent, self._is_read = np.zeros((_READINGS, count)), False

    def begin(self, x: Array, P: Array) -> None:
        """Begin all at the state x (d,) of covariance P (d, d)."""
        self._unsettled = _SETTLING
        self._copy(x, P)

    def _copy(self, x: Array, P: Array) -> None:
        count = len(self._beacons)
        self._x, self._P, self.mistrusts = np.tile(x, (count, 1)), np.tile(P, (count, 1, 1)), False
        self._recent[:], self._refused[:] = 0.0, 0

    def predict(self, u: Array, h: float) -> None:
        """Move all for h [s] with the odometry and the densities of its noise u (4,) held."""
        predict(self._x, self._P, u[0], u[1], h, u[2], u[3])
        self._left -= h
        self._unsettled -= h
        those = slice(-1) if self.mistrusts else slice(-1, None)
        mistrust(self._x[those], self._P[those], h)

    def condition(self, y: Array) -> None:
        """Condition on a reading y (rows,), each filter but for its beacon."""
        self._is_read = True
        for row in np.flatnonzero(np.isfinite(y)).tolist():
            kind, i = self._model.entries[row]
            those = self._beacons != i
            x, P, found = self._x[those], self._P[those], np.empty((len(self._beacons) - 1, 3))
            condition(
                x, P, np.zeros(len(x)), float(y[row]), kind, i, self._model.places, self._model.columns,
                self._errors[kind], found,
            )  # fmt: skip
            self._x[those], self._P[those] = x, P
            self._refused[those] = np.where(found[:, 2] < _DOUBTFUL, self._refused[those] + 1, 0)

    def judge(self, x: Array, P: Array) -> tuple[Array, Array] | None:
        """Judge a state x (d,) of all readings with P (d, d); what to go on from where its odometry is wrong, or right
        again.
        """
        if self._unsettled > 0.0 and P[2, 2] > _TURNED**2 and not self.mistrusts:
            self._copy(x, P)
        else:
            self._unsettled = 0.0
        lost = self._refused >= _SEQUENCE
        if lost.any():
            self._x[lost], self._P[lost], self._refused[lost], self._recent[:, lost] = x, P, 0, 0.0
        if self._is_read:
            self._recent[1:], self._is_read = self._recent[:-1].copy(), False
        separations(x, P, self._x, self._P, _LEAST, _DEVIATIONS, self._recent[0], self._levels)
        self.squares = squares = np.sort(self._recent, axis=0)[1]
        self.level = (self._levels[:-1] if self.mistrusts else self._levels).max(axis=0)
        if not self.mistrusts:
            return self.mistrusted(WRONG)
        self._largest = max(self._largest, float(squares[-1]))
        if self._left > 0.0:
            return None
        scales = (np.square(self._x[-1, ODOMETRY_SCALES]) / self._declared).sum()
        self._passed = 0 if self._largest > _ALIKE or scales > _USUAL else self._passed + 1
        if self._passed < _TWICE:
            self._trust(x, P)
            return None
        better = self._x[-1].copy(), self._P[-1].copy()
        self.begin(*better)
        return better

    def mistrusted(self, least: float) -> tuple[Array, Array] | None:
        """Mistrust the odometry from now on if its separation is the largest, above ``least``; what to go on from."""
        if self.mistrusts or self.squares[-1] <= least or self.squares[-1] < self.squares.max():
            return None
        better = self._x[-1].copy(), self._P[-1].copy()
        self.begin(*better)
        self.mistrusts, self._passed = True, 0
        self._trust(*better)
        return better

    def _trust(self, x: Array, P: Array) -> None:
        """Begin the last filter at x (d,), P (d, d), with the scale errors of odometry as they are declared."""
        for k, variance in zip((3, 4), self._declared.tolist(), strict=True):
            gain = P[:, k] / (P[k, k] + variance)
            x, P = x - gain * x[k], P - np.outer(gain, P[k])
        self._x[-1], self._P[-1] = x, P
        self._recent[:, -1] = 0.0
        self._left, self._largest = self._lasts, 0.0

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        made = copy.copy(self)
        made._model = copy.deepcopy(self._model, memo)
        made._x, made._P, made._levels = self._x.copy(), self._P.copy(), self._levels.copy()
        made._recent, made._refused = self._recent.copy(), self._refused.copy()
        made.squares, made.level = self.squares.copy(), self.level.copy()
        return made
