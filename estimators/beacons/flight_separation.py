"""Solution separation of a flight: filters without a sensor each, beside the filter of all.

If only one beacon is at fault, or only the fixes are, the filter without that sensor knows nothing of it: its error is
as its covariance P_i says, whatever the fault is and since when. With x_0 of all readings it follows, of the position
and of the velocity, that

    |error of x_0| <= |x_i - x_0| + 3 sqrt(lambda_max(P_i)),

but for what three deviations leave out. The largest of these over all i is the protection level of a single fault.
[R. G. Brown, P. W. McBurney, Self-contained GPS integrity check using maximum solution separation, Navigation 35, 1988]

It is infinite while the position without one of them is so uncertain that derivatives at it mean nothing: three ranges
do not tell a place without one of them for long. A filter that is so uncertain, or refuses its readings, begins again
at x_0 with a covariance that says nothing of it, and has no level until that has become small. The side of the plane of
the others is taken from all of them, for three of four ranges fit the mirror image too. The level assumes gusts as they
are declared.
"""

from __future__ import annotations

import copy
import math
from typing import Self

import numpy as np

from mathnavi.estimators.beacons.flight_geometry import beacons_of_rows, mirrored, plane_of
from mathnavi.estimators.beacons.flight_kernels import FIX, condition_flights, flight_separations, predict_flights
from mathnavi.estimators.beacons.flight_side import Side
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.aerial.beacon_readings import AZIMUTH, BeaconRows
from mathnavi.models.aerial.beacons import slant_ranges

_DEVIATIONS = 3.0
_LINEAR = 0.1  # of the nearest range: largest deviation of a position at which a derivative means something
_SMALL = 0.5  # of that: the deviation up to which a filter that has begun again has a level
_FAR = 6.0  # deviations of a level at which a filter may be on the other side
_SEQUENCE = 10  # instants in sequence at which most readings are refused
_FIXES, _AXES = -1, 3


class FlightSeparation:
    """Filters beside that of all readings: without each beacon, and without the fixes where there are beacons too."""

    def __init__(self, rows: BeaconRows, gate: float, fix_variance: float | None, speed: float, gust: float) -> None:
        """``gate`` is the nu^2 / S above which a filter refuses a number, ``fix_variance`` [m^2] that of a fix, None
        without fixes; a flight of which nothing is known has a speed [m/s] and gusts [m/s^2] of these deviations.
        """
        n, axes = len(rows.places), 0 if fix_variance is None else _AXES
        self._rows, self._gate = rows, gate
        order = np.argsort(rows.kinds, kind="stable")  # differences last
        self._order = order
        self._kinds = np.append(np.full(axes, FIX), rows.kinds[order]).astype(np.int64)
        self._beacons = np.append(np.arange(axes), rows.beacons[order]).astype(np.int64)
        self._variance = np.append(np.full(axes, fix_variance or 0.0), rows.variance[order])
        self._axes = axes
        self._without = np.append(np.arange(n), [_FIXES] * (axes > 0)).astype(np.int64)
        count = len(self._without)
        self._unknown = np.diag(np.repeat([1.0, speed**2, gust**2], 3))  # but for that of the position
        self._x, self._P = np.zeros((count, 10)), np.zeros((count, 10, 10))
        self._refused, self._sequence = np.empty(count), np.zeros(count, dtype=np.int64)
        self._lost = np.zeros(count, dtype=np.bool_)  # those that have begun again, and know nothing yet
        self._levels = np.empty((count + 1, 3))
        self.level = np.full(2, np.nan)
        """protection level (2,) [m], [m/s] of the last state that was judged"""

    def begin(self, x: Array, P: Array) -> None:
        """Begin all at a state x (9,) of covariance P (9, 9) that no sensor has told."""
        self._x[:, :9], self._P[:, :9, :9] = x, P
        self._lost[:], self._sequence[:] = False, 0

    def begin_again(self, x: Array, those: Flags | None = None) -> None:
        """Begin ``those`` (N,), or all, at a state x (9,) of which they know nothing."""
        chosen = np.ones(len(self._x), dtype=np.bool_) if those is None else those
        unknown = self._unknown.copy()
        unknown[:3, :3] *= self._linear(x) ** 2
        self._x[chosen, :9], self._P[chosen, :9, :9] = x, unknown
        self._lost[chosen], self._sequence[chosen] = True, 0

    def predict(self, F: Array, B: Array, Q: Array) -> None:
        """Predict all by F (3, 3) and Q (3, 3) of an axis and the effect B (9,) of the input."""
        predict_flights(self._x, self._P, F, B, Q)

    def condition(self, y: Array, *, beacons: bool, common: float = 0.0) -> None:
        """Condition on the numbers of an instant: y (m,) of beacons, or a fix (3,); ``common`` [m^2] is the variance of
        the arrival from beacon 0.
        """
        numbers = np.full(len(self._kinds), np.nan)
        if beacons:
            numbers[self._axes :] = np.where(np.isfinite(y), y, np.nan)[self._order]
        else:
            numbers[: self._axes] = y
        condition_flights(
            self._x, self._P, numbers, self._kinds, self._beacons, self._rows.places, self._variance, common,
            self._gate, self._without, self._refused,
        )  # fmt: skip
        read = np.isfinite(self._refused)
        self._sequence[read] = np.where(self._refused[read] > 0.5, self._sequence[read] + 1, 0)

    def judge(self, x: Array, P: Array, *, heard: Integers) -> Array:
        """Protection level (2,) [m], [m/s] of a state x (9,) with P (6, 6); ``heard`` are the rows that are read."""
        limit = self._linear(x)
        flight_separations(x[:6], P, self._x, self._P, _DEVIATIONS, self._levels)
        deviations = self._levels[:-1, 2]
        far = np.flatnonzero(self._levels[:-1, 0] > _FAR * deviations).tolist()
        if sum(self._take_side(i, x, heard) for i in far):
            flight_separations(x[:6], P, self._x, self._P, _DEVIATIONS, self._levels)
        self._lost &= deviations > _SMALL * limit
        wrong = (deviations > limit) | (self._sequence > _SEQUENCE)
        if wrong.any():
            self.begin_again(x, wrong)
        if self._lost.any():
            self.level = np.full(2, math.inf)
        else:
            self.level = self._levels[:, :2].max(axis=0)
        return self.level

    def _take_side(self, i: int, x: Array, heard: Integers) -> bool:
        """Go over to the mirror image in the plane of the beacons that filter i hears, if the state x (9,) is there."""
        rows = heard[self._rows.beacons[heard] != self._without[i]]
        if (self._rows.kinds[rows] == AZIMUTH).any() or (self._axes and self._without[i] != _FIXES):
            return False  # which have no image
        plane = plane_of(self._rows.places[beacons_of_rows(self._rows, rows)]) if len(rows) else None
        if plane is None:
            return False
        own = self._x[i, :3]
        image = mirrored(own, *plane)
        if 2.0 * math.dist(image, x[:3]) > math.dist(own, x[:3]):
            return False
        other = Side(self._x[i, :9], self._P[i, :9, :9]).image(*plane)
        self._x[i, :9], self._P[i, :9, :9] = other.x, other.P
        return True

    def _linear(self, x: Array) -> float:
        """The largest deviation [m] of a position at which derivatives mean something."""
        return _LINEAR * max(float(slant_ranges(self._rows.places, x[:3])[0].min()), 1.0)

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        made = copy.copy(self)
        for name in ("_x", "_P", "_refused", "_sequence", "_lost", "_levels", "level"):
            setattr(made, name, getattr(self, name).copy())
        return made
