"""The mission in the form that compiled filters use: wall, rays and errors.

Their state is (x_1, x_2, phi, b), the pose and the scale error of the odometry, u = (1 - b) u_measured; see
``kalman_kernels``. A constant error accumulates, whereas errors that are independent between readings average out: for
a filter that models a constant error as independent ones, it limits the accuracy.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from mathnavi.estimators.ranging.kalman_kernels import RaySensors, step_within, within
from mathnavi.estimators.timeout_monitor import InnovationMean
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.mission import LEAST_NOISE, RangingMission

STATES = 4
FROM_WHERE = "from most starts with two rays or more while the robot drives; at rest not with one or two rays"
"""condition that an estimator with local convergence states in addition"""

_LEAST_VARIANCE = 1e-12  # [m^2/s^2, rad^2/s^2] of an input
_DRAWN = 500  # poses that stand for "anywhere"
_LASTING = 10  # readings in a row beyond the gate

Flags = NDArray[np.bool_]


class RangeModel:
    """Model of a robot's motion and of its rays, with the errors that the mission declares."""

    def __init__(self, mission: RangingMission) -> None:
        ranging, odometry = mission.ranging, mission.odometry
        self.wall = mission.curve.wall
        self.angles, self.rays = mission.alpha, mission.rays  # (l,) [rad]; (l, 3) with the places of the sensors
        self.relative = ranging.relative
        self.absolute = math.hypot(ranging.absolute, LEAST_NOISE)  # [m]
        self.outliers = ranging.outliers
        self.W = np.square(odometry.noise) + np.square(odometry.slip) + _LEAST_VARIANCE  # (2,) of what is new each time
        self.scale = odometry.bias  # standard deviation of b
        carried = mission.sensors_carried()[0]
        self.longest, self.too_long = carried.longest, carried.too_long  # [m]
        self._mission = mission

    def __deepcopy__(self, memo: object) -> RangeModel:
        """Itself: nothing changes it, and copies of an estimator share it."""
        return self

    def range_variance(self, rho: Array) -> Array:
        """Variances (l,) [m^2] of readings of ranges rho (l,) [m]."""
        variance: Array = np.square(self.relative * rho) + self.absolute**2
        return variance

    def sensors(self, gate: float) -> RaySensors:
        """The range sensors for compiled code, with the ``gate`` nu^2 / s above which a reading is an outlier."""
        return RaySensors(self.rays, self.relative, self.absolute, gate, self.outliers, self.longest)

    def covariance(self, deviation: tuple[float, float, float]) -> Array:
        """Covariance (4, 4) of a pose known to standard deviations [m, m, rad], and of b as declared."""
        return np.diag(np.square([*deviation, self.scale]))

    def anywhere(self, rng: np.random.Generator, count: int) -> Array:
        """Draw states (count, 4): poses uniform within the wall, and b as declared."""
        low, high = self.wall[1].min(axis=0), self.wall[1].max(axis=0)
        points = np.empty((0, 2))
        while len(points) < count:
            points = np.concatenate((points, within(self.wall, rng.uniform(low, high, (count, 2)))))
        headings, scales = rng.uniform(-math.pi, math.pi, count), self.scale * rng.standard_normal(count)
        return np.column_stack((points[:count], headings, scales))

    def particles(self, count: int, rng: np.random.Generator) -> Array:
        """Draw states (count, 4) at t = 0: around the known start within the wall, or anywhere if the start is not
        known.
        """
        known = self._mission.start
        if known is None:
            return self.anywhere(rng, count)
        middle = np.array([*known.pose, 0.0])
        x: Array = middle + np.sqrt(np.diag(self.covariance(known.deviation))) * rng.standard_normal((count, STATES))
        for n in range(count):
            offset = x[n, :2] - middle[:2]
            x[n, :2] = middle[:2] + step_within(self.wall, *middle[:2], *offset) * offset
        return x

    def start(self) -> tuple[Array, Array]:
        """State x (4,) and covariance P (4, 4) at t = 0: the known start, or the middle of the field if the start is
        not known.
        """
        known = self._mission.start
        if known is not None:
            return np.array([*known.pose, 0.0]), self.covariance(known.deviation)
        p = self.anywhere(np.random.default_rng(0), _DRAWN)[:, :2]
        middle = p[np.argmin(np.square(p - p.mean(axis=0)).sum(axis=1))]  # the mean itself may be outside
        P = self.covariance((0.0, 0.0, math.pi / math.sqrt(3.0)))
        P[:2, :2] = (p - middle).T @ (p - middle) / _DRAWN
        return np.array([*middle, 0.0, 0.0]), P


def chi_square_gate(probability: float) -> float:
    """Gate that nu^2 / s of a good ray exceeds with this probability: chi-square, one degree of freedom."""
    return float(chdtri(1, probability))


class Gate:
    """Gate that refuses rays whose nu^2 / s marks them as outliers; if that lasts it is the filter's error, and they
    pass.
    """

    def __init__(self, probability: float, sensors: int, counts: ReadingCounts) -> None:
        """``counts`` gets the rays that are refused."""
        self._limit, self._counts = chi_square_gate(probability), counts
        self._squares = np.full(sensors, np.nan)  # nu^2 / s of the last reading
        self._innovations = InnovationMean(self._limit)
        self._beyond = np.zeros(sensors, dtype=int)  # readings in a row

    def passes(self, squares: Array) -> Flags:
        """True (l,) where a ray is to be used, by its nu^2 / s (l,), NaN where a ray was lost."""
        beyond = squares > self._limit
        self._beyond = np.where(beyond, self._beyond + 1, np.where(np.isnan(squares), self._beyond, 0))
        passed: Flags = np.isfinite(squares) & ((self._beyond == 0) | (self._beyond > _LASTING))
        if beyond.any():
            self._counts.add(Unused.OUTLIER, int((beyond & ~passed).sum()))
        self._squares = squares
        return passed

    def passed(self, squares: Array) -> None:
        """Take the nu^2 / s (l,) of rays that a filter has weighed itself, NaN where a ray was lost."""
        if beyond := int((squares > self._limit).sum()):
            self._counts.add(Unused.OUTLIER, beyond)
        self._squares = squares

    def agrees(self, converged: bool) -> bool:
        """True if the rays of the last readings fit an estimate, which is not asked of one that has ``converged``."""
        return self._innovations.fits(self._squares[np.isfinite(self._squares)], converged)
