"""filterpy's extended Kalman filter for a robot that reads ranges: the baseline of the other filters.

It does not account for linearisation errors.
"""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.kalman_steps import external_prediction_ekf
from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.model import STATES
from mathnavi.estimators.ranging.pose_filter import PoseFilter, PoseFilterConfig
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import integrate_jacobians, wrapped
from mathnavi.models.unicycle.mission import RangingMission


class RangeEkf(PoseFilter):
    """Estimator of the pose from ranges and odometry: one extended Kalman filter."""

    def __init__(self, config: PoseFilterConfig, mission: RangingMission) -> None:
        super().__init__(config, mission)
        self._filter = external_prediction_ekf(STATES, mission.sensors)
        self._filter.x, self._filter.P = self._model.start()

    def _pose(self) -> tuple[Array, Array]:
        return self._filter.x[:3].copy(), self._filter.P[:3, :3]

    def _predict(self, u: Array, dt: float) -> None:
        x = self._filter.x.copy()
        v = (1.0 - x[3]) * u
        F, G = integrate_jacobians(x[:3], v[0], v[1], dt)
        A, Q = np.eye(STATES), np.zeros((STATES, STATES))
        A[:3, :3], A[:3, 3] = F, -G @ u
        Q[:3, :3] = G * self._model.W @ G.T
        move(x, u, self._model.wall, dt)
        self._filter.F, self._filter.Q = A, Q
        self._filter.predict(x)

    def _condition(self, rho: Array) -> Array:
        x, model = self._filter.x.copy(), self._model
        h, H = expected_ranges(model.wall, x[:3], model.angles)
        H = np.column_stack((H, np.zeros(len(h))))
        variance = model.range_variance(h)
        good = self._gate.passes(np.square(rho - h) / (np.einsum("ij,jk,ik->i", H, self._filter.P, H) + variance))
        if not good.any():
            return np.full(2, np.nan)
        R = np.diag(variance[good])
        self._filter.update(rho[good], lambda _: H[good], lambda _: h[good], R=R)
        step = step_within(model.wall, x[0], x[1], *(self._filter.x - x)[:2])
        self._filter.x = x + step * (self._filter.x - x)
        self._filter.x[2] = wrapped(self._filter.x[2])
        y = self._filter.y
        return np.array([y @ self._filter.SI @ y, len(y)])
