"""The robot that reads ranges as a ``StagewiseModel``: its pose and the scale error of its odometry.

The model of ``mathnavi.estimators.ranging.pose_filter``. Within a polygon a reading gets the walls on which its rays
end when it is added (``wall_association_kernels``), and keeps them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.map_fit import MapFit
from mathnavi.estimators.ranging.model import STATES, RangeModel
from mathnavi.estimators.ranging.reader import RANGES, RangeReader
from mathnavi.estimators.ranging.wall_association_kernels import associated, ranges_to
from mathnavi.estimators.stagewise.model import Piece
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import NOTHING, Array, Measurement
from mathnavi.models.unicycle.kernels import integrate_jacobians, wrapped
from mathnavi.models.unicycle.mission import RangingMission

_REFUSED = 1e-4  # probability of an outlier where none is declared
_LARGEST = 6.0  # standard deviations of the scale error


class RangingModel:
    """Model of pose and scale error (x_1, x_2, phi, b) [m, m, rad, -]."""

    size = STATES

    def __init__(self, mission: RangingMission) -> None:
        self._model, self._bias = RangeModel(mission), mission.odometry.bias
        self._reader = RangeReader(mission, math.inf)
        self._sensors = self._model.sensors(math.inf).noisier(1.0, max(self._model.outliers, _REFUSED))
        self.fit = MapFit(mission)
        """how well the ranges fit the map"""
        self.is_ambiguous = self.fit.has_corners
        self.rows = mission.sensors

    def start(self, reading: Array | None) -> tuple[Array, Array]:
        return self._model.start()

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        measured = self._reader.odometry(measurements)
        return ((end - begin, (command if measured is None else measured).copy()),)

    def reading(self, measurement: Measurement) -> Array | None:
        if measurement.name != RANGES:
            return None
        rho = self._reader.ranges([measurement])
        return rho if self._reader.rays else None

    def unused(self, measurement: Measurement) -> Unused | None:
        """Return None: a ``RangeReader`` counts rays."""
        return None

    def restart(self) -> bool:
        return False

    def transition(self, x: Array, u: Array, h: float) -> tuple[Array, Array, Array]:
        v = (1.0 - x[3]) * u
        F_pose, G = integrate_jacobians(x[:3], v[0], v[1], h)
        F, Q = np.eye(STATES), np.zeros((STATES, STATES))
        F[:3, :3], F[:3, 3] = F_pose, -G @ u
        Q[:3, :3] = G * self._model.W @ G.T
        after = x.copy()
        move(after, u, self._model.wall, h)
        return after, F, Q

    def associated(self, x: Array, P: Array, y: Array) -> Array:
        """Ranges y (l,) within a polygon as rows (l, 3), with the walls of the rays (``wall_association_kernels``)."""
        return associated(x, P, y, self._model.wall, self._sensors)

    def conditioned(self, x: Array, P: Array, y: Array) -> tuple[Array, Array]:
        """State and covariance (4, 4) after ranges y (l,) within a polygon (``wall_choice_kernels``)."""
        x, P = x.copy(), np.array(P, order="C")
        self.fit.condition(x, P, y, self._model.wall, self._sensors)
        return x, P

    def compare(self, x: Array, P: Array, y: Array) -> None:
        """Compare a reading y (l,) with an estimate, of covariance P (4, 4), that has used it."""
        self.fit.compare(x, P, y, self._model.wall, self._sensors)

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        h, H, sigma = self._expected(x, y)
        W = np.zeros((len(h), STATES))
        W[:, :3] = H / sigma[:, np.newaxis]
        return ((y if y.ndim == 1 else y[:, 0]) - h) / sigma, W

    def noise(self, x: Array, y: Array) -> Array:
        return self._expected(x, y)[2]

    def _expected(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Ranges h (l,) [m] at x, where a reading y has them, their derivatives (l, 3) and deviations (l,) [m]."""
        model = self._model
        if y.ndim == 1:
            h, H = expected_ranges(model.wall, x[:3], model.rays)
            return h, H, np.sqrt(model.range_variance(h))
        h, H = ranges_to(model.wall, x[:3], model.rays, y[:, 1])
        return h, H, np.sqrt(model.range_variance(h) / y[:, 2])

    def deviations(self, x: Array) -> tuple[Array, Array]:
        """Standard deviations (l,) [m] of the ranges at x, and their derivatives (l,) by the range."""
        h, _ = expected_ranges(self._model.wall, x[:3], self._model.rays)
        sigma = np.sqrt(self._model.range_variance(h))
        return sigma, self._model.relative**2 * h / sigma

    def sum(self, x: Array, e: Array) -> Array:
        """State x + e, its position kept within the wall."""
        after: Array = x + e
        step = step_within(self._model.wall, x[0], x[1], e[0], e[1])
        after[:2] = x[:2] + step * e[:2]
        after[2] = wrapped(after[2])
        return after

    def difference(self, other: Array, x: Array) -> Array:
        error: Array = other - x
        error[2] = wrapped(error[2])
        return error

    def limits(self, x: Array) -> tuple[Array, Array]:
        """Limits of the error: the scale error is within six standard deviations."""
        high = np.array([np.inf, np.inf, np.inf, max(_LARGEST * self._bias, 1e-9)])
        return -high - x, high - x

    def extra(self, x: Array, P: Array) -> Mapping[str, Array]:
        return NOTHING

    def reported(self, x: Array, P: Array) -> tuple[Array, Array]:
        return x[:3].copy(), self.fit.inflation * P[:3, :3]
