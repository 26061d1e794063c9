"""The Kalman filter of a flight together with places of beacons: the state (p, v, g, b_1, ..., b_m) (9 + 3 m,).

It starts from a state and a covariance of the flight that knows nothing of what is read of b_j, and uses each reading
since then once: fixes, what is read of beacons at known places, and y_j = h(p - b_j) + n, a range, an azimuth or an
elevation. With d = p - b_j and the derivative e of h by d,

    H = (e', 0, 0, ..., -e', ...),    P_dd = P_pp + P_bb - P_pb - P_bp,

so the errors of the way and of a place that was found from it are correlated as they are. A difference |p - b_j| -
|p - b_0| + n_j - n_0 has, with e_0 the direction of the range to beacon 0,

    H = (e' - e_0', 0, 0, ..., -e', ..., -1),

the last number for n_0, the noise of the arrival from beacon 0, which is a number of the state while differences of an
instant are used. Before a place is known, what is read of it is linearised about one that a batch fit has found
(``flight_place_fit``), with a prior so wide that it tells nothing: the last step of Gauss and Newton's method, about
the joint problem. After that, each number is used by the second-order extended Kalman filter about the state, as all
others are (``flight``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from mathnavi.estimators.beacons.flight_quality import thrice
from mathnavi.estimators.flight_model import AxisModel
from mathnavi.estimators.timeout_monitor import time_ahead
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacon_readings import DIFFERENCE, RANGE, BeaconRows, curvature_effects, reading_of
from mathnavi.models.tolerances import TIME_TOLERANCE

OUTLIER = float(chdtri(1, 1e-9))
_WIDE = 30.0  # times its range: standard deviation of a place of which nothing is known
_I3 = np.eye(3)


@dataclass(frozen=True, eq=False)
class Step:
    """Readings up to a time."""

    t: float  # [s]
    command: Array  # (3,) [m/s^2] since the step before
    fixes: Sequence[tuple[float, Array]]  # t [s] and the fix (3,) [m], NaN on an axis that is not to be used
    readings: Sequence[tuple[float, Array]]  # t [s] and numbers (m,) of all beacons, NaN for those not to be used


@dataclass(frozen=True, eq=False)
class Noise:
    """Assumptions of a joint filter on its readings and on the motion."""

    axis: AxisModel
    rows: BeaconRows  # of all beacons, with places (n, 3) that are NaN for those not known
    fix_variance: float  # [m^2]


class JointFlight:
    """The filter."""

    def __init__(self, noise: Noise, t: float, x: Array, P: Array, places: dict[int, tuple[Array, float]]) -> None:
        """Start at t [s] with x (9,) and P (9, 9); ``places`` are those about which readings are linearised (3,) [m],
        by the numbers of their beacons, and ranges [m] of them.
        """
        self.t, self._noise = t, noise
        given: NDArray[np.bool_] = np.asarray(np.isfinite(noise.rows.places).all(axis=1))
        self._known = given[noise.rows.beacons]  # (m,) of the rows
        self.numbers = tuple(places)
        """beacons of the state"""
        m = len(places)
        self.about: dict[int, Array] | None = {i: place for i, (place, _) in places.items()}
        """places about which readings are linearised; None for those of the state"""
        self.x: Array = np.concatenate([x, *self.about.values()])
        self.P: Array = np.zeros((9 + 3 * m, 9 + 3 * m))
        self.P[:9, :9] = P
        for j, (_, rho) in enumerate(places.values()):
            at = slice(9 + 3 * j, 12 + 3 * j)
            self.P[at, at] = (_WIDE * max(rho, 1.0)) ** 2 * _I3
        self.log_likelihood = 0.0
        self._discrete: dict[float, tuple[Array, Array, Array]] = {}

    def place(self, i: int) -> tuple[Array, Array]:
        """Place (3,) [m] of beacon i and its covariance (3, 3)."""
        at = self._at(i)
        return self.x[at].copy(), self.P[at, at].copy()

    def _at(self, i: int) -> slice:
        j = self.numbers.index(i)
        return slice(9 + 3 * j, 12 + 3 * j)

    def advance(self, step: Step) -> list[tuple[int, float]]:
        """Use what was read; return the normalised innovations of the beacons of the state, by their rows."""
        found = []
        events = [(t, 0, value) for t, value in step.fixes] + [(t, 1, value) for t, value in step.readings]
        for t, kind, value in sorted(events, key=lambda each: each[:2]):
            self._predict(t, step.command)
            if kind == 0:
                for k in np.flatnonzero(np.isfinite(value)).tolist():
                    H = np.zeros(len(self.x))
                    H[k] = 1.0
                    self._condition(H, float(value[k] - self.x[k]), self._noise.fix_variance)
            else:
                found += self._use(value)
        self._predict(step.t, step.command)
        return found

    def _predict(self, t: float, command: Array) -> None:
        h = time_ahead(t, self.t)
        if h <= TIME_TOLERANCE:
            return
        key = round(h, 10)
        if key not in self._discrete:
            F, B, Q = self._noise.axis.discretised(h)
            self._discrete[key] = thrice(F), B, thrice(Q)
        F, B, Q = self._discrete[key]
        self.x[:9] = F @ self.x[:9] + np.outer(B, command).ravel()
        cross = F @ self.P[:9, 9:]
        self.P[:9, :9] = F @ self.P[:9, :9] @ F.T + Q
        self.P[:9, 9:], self.P[9:, :9] = cross, cross.T
        self.t = t

    def _use(self, y: Array) -> list[tuple[int, float]]:
        """Use the numbers (m,) of an instant; return the normalised innovations of beacons of the state."""
        rows = self._noise.rows
        read = np.flatnonzero(np.isfinite(y))
        size, shared = len(self.x), bool((rows.kinds[read] == DIFFERENCE).any())
        if shared:  # n_0
            self.x, self.P = np.append(self.x, 0.0), np.pad(self.P, (0, 1))
            self.P[-1, -1] = rows.common
        for k in read[self._known[read]].tolist():
            self._use_known(k, float(y[k]))
        placed = [(i, k) for i in self.numbers for k in read[rows.beacons[read] == i].tolist()]
        found = [(k, self._use_placed(i, k, float(y[k]))) for i, k in placed]
        if shared:
            self.x, self.P = self.x[:size].copy(), self.P[:size, :size].copy()
        return found

    def _use_known(self, k: int, y: float) -> None:
        """Use row k, of a beacon at a known place."""
        rows = self._noise.rows
        h, e, D = rows.at(k, self.x[:3])
        mean, variance = curvature_effects(self.P[:3, :3], D)
        H = np.zeros(len(self.x))
        H[:3] = e
        if rows.kinds[k] == DIFFERENCE:
            h, H[-1] = h - self.x[-1], -1.0
        self._condition(H, rows.innovation(k, y, h) - mean, float(rows.variance[k]) + variance)

    def _use_placed(self, i: int, k: int, y: float) -> float:
        """Use row k, of beacon i of the state; return its normalised innovation."""
        rows, at, p, P = self._noise.rows, self._at(i), self.x[:3], self.P[:3, :3]
        kind, b = int(rows.kinds[k]), self.x[at]
        h, e, D = reading_of(RANGE if kind == DIFFERENCE else kind, b if self.about is None else self.about[i], p)
        H = np.zeros(len(self.x))
        H[:3], H[at] = e, -e
        D_0 = np.zeros((3, 3))
        if kind == DIFFERENCE:
            reference, e_0, D_0 = reading_of(RANGE, rows.places[0], p)
            h -= reference + self.x[-1]
            H[:3] -= e_0
            H[-1] = -1.0
        if self.about is not None:
            h = h - float(e @ (b - self.about[i]))
            mean, variance = (0.0, 0.0) if kind == RANGE else curvature_effects(P, D - D_0)  # of a range it is nothing
        elif kind == DIFFERENCE:
            both = np.r_[:3, at]
            mean, variance = curvature_effects(self.P[np.ix_(both, both)], np.block([[D - D_0, -D], [-D, D]]))
        else:
            cross = self.P[:3, at]
            mean, variance = curvature_effects(P + self.P[at, at] - cross - cross.T, D)
        return self._condition(H, rows.innovation(k, y, h + mean), float(rows.variance[k]) + variance)

    def _condition(self, H: Array, nu: float, R: float) -> float:
        """Condition on an innovation unless it is an outlier; return it over its deviation."""
        PH = self.P @ H
        S = float(H @ PH) + R
        e = nu / math.sqrt(S)
        self.log_likelihood -= 0.5 * (min(e * e, OUTLIER) + math.log(S))
        if e * e <= OUTLIER:
            self.x = self.x + PH * (nu / S)
            P = self.P - np.outer(PH, PH / S)
            self.P = 0.5 * (P + P.T)
        return e
