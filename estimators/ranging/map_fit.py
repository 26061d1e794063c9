"""How well readings fit a map of a building: how many it does not explain, and how long an error of it lasts.

What stands there and is not on the map makes misfits (``wall_choice_kernels``): while a third of the recent ranges are
misfits, a pose that fits the others is not to be relied on, and while two thirds are, a search does better to begin
again. What the map is wrong by stays from one scan to the next,
which a filter takes for independent: with the correlation r of the residuals of a ray with those before, the covariance
of its estimate is that of an autoregressive error of first order, (1 + r) / (1 - r) times the filter's.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import RaySensors, no_innovations
from mathnavi.estimators.ranging.wall_choice_kernels import condition_among_walls, learn_correlation, misfits
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.mission import RangingMission

_RECENT = 16.0  # readings over which the share of those that are not explained is averaged
_MANY = 1.0 / 3.0  # of them, from which on the map lacks too much of what is there
_MOST = 2.0 / 3.0  # of them, from which on the pose is hardly the right one
_CORRELATION, _PRIOR = 0.4, 50.0  # r at first, as at SLAM's poses on maps of scans, and the readings that it counts as
_MOST_CORRELATED = 0.8  # r at most


class MapFit:
    """Misfits and correlation of a filter's readings; within a smooth curve there are none."""

    def __init__(self, mission: RangingMission) -> None:
        self.has_corners = isinstance(mission.curve, Polygon)
        self.innovations = no_innovations(mission.sensors)
        """innovations of the last update, written by the kernels"""
        self._share = 0.0

    def note(self, unexplained: int, rays: int) -> None:
        """Take an update: the number of ``rays`` that read something, and of those that stay ``unexplained``."""
        if rays and self.has_corners:
            self._share += (1.0 - math.exp(-rays / _RECENT)) * (unexplained / rays - self._share)

    def condition(self, x: Array, P: Array, rho: Array, wall: WallShape, sensors: RaySensors) -> tuple[float, int]:
        """Condition x (4,) and P (4, 4), in place, on ranges rho (l,) [m] within a polygon; return NIS and its rays."""
        _, nis, rays = condition_among_walls(x, P, rho, wall, sensors, self.innovations)
        if rays:
            self.note(int(self.innovations.misfits[0]), rays)
            learn_correlation(self.innovations)
        return nis, rays

    def compare(self, x: Array, P: Array, rho: Array, wall: WallShape, sensors: RaySensors) -> None:
        """Take ranges rho (l,) [m] that an estimate x (4,), P (4, 4) of another filter has used."""
        if self.has_corners:
            found = misfits(x, P, rho, wall, sensors, self.innovations.fits[0])
            self.note(found, int(np.isfinite(rho).sum()))
            learn_correlation(self.innovations)

    def begin_again(self) -> None:
        """Go on at a pose that the readings so far do not tell of: it has to show that it explains them."""
        self._share = min(self._share, _MANY)

    @property
    def is_refuted(self) -> bool:
        """True where the map explains so few of the recent readings that the pose is hardly the right one."""
        return self._share >= _MOST

    def judged(self, status: Status) -> Status:
        """The ``status`` of an estimate, ``DEGRADED`` where the map explains too few of the recent readings."""
        return Status.DEGRADED if status is Status.OK and self.doubt else status

    @property
    def doubt(self) -> str:
        """Why the status that is ``judged`` is DEGRADED; "" if it is not."""
        return "explains too few of its ranges by the map" if self._share >= _MANY else ""

    @property
    def inflation(self) -> float:
        """(1 + r) / (1 - r), the variance of a mean of correlated errors over that of independent ones."""
        if not self.has_corners:
            return 1.0
        product, square = (float(each) for each in self.innovations.products)
        r = min(max((_CORRELATION * _PRIOR + product) / (_PRIOR + square), 0.0), _MOST_CORRELATED)
        return (1.0 + r) / (1.0 - r)
