"""The plug-in ``range_iekf``: the invariant extended Kalman filter on SE(2) of a robot that reads ranges.

The state is the pose, an element X of SE(2), and the scale error b of the odometry. With the odometry u, held for dt,

    X <- X Exp(v),   v = dt ((1 - b) u_1, 0, (1 - b) u_2),

exactly. The error is left-invariant, X = X^ Exp(xi): it is expressed in the robot's own axes, as the error of the
odometry is. So

    xi <- Ad_{Exp(-v)} xi - J_r(v) dt u db + J_r(v) dt w

at every pose: if b is known, the propagation of the error is exact, and its covariance does not depend on the estimate;
a Gaussian of xi is banana-shaped in (x_1, x_2, phi). A ray reads rho_i = h_i(X) of a wall that is not invariant under
motions, so the update is linearised about the estimate, as in ``range_ekf``. There is no other difference from that
filter.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.invariant.lie_groups import SE2
from mathnavi.estimators.kalman_steps import condition
from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.model import STATES
from mathnavi.estimators.ranging.pose_filter import PoseFilter, PoseFilterConfig
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.models.unicycle.mission import RangingMission


class RangeIekf(PoseFilter):
    """Estimator of the pose from ranges and odometry: one invariant extended Kalman filter on SE(2)."""

    def __init__(self, config: PoseFilterConfig, mission: RangingMission) -> None:
        super().__init__(config, mission)
        self._x, P = self._model.start()
        axes = _axes(self._x)
        self._P = axes.T @ P @ axes  # of (xi, b)

    def _pose(self) -> tuple[Array, Array]:
        axes = _axes(self._x)[:3, :3]
        return self._x[:3].copy(), axes @ self._P[:3, :3] @ axes.T

    def _predict(self, u: Array, dt: float) -> None:
        moved = (1.0 - self._x[3]) * dt * np.array([u[0], 0.0, u[1]])
        G = dt * SE2.right_jacobian(moved)[:, [0, 2]]
        A, Q = np.eye(STATES), np.zeros((STATES, STATES))
        A[:3, :3], A[:3, 3] = SE2.adjoint(SE2.exp(-moved)), -G @ u
        Q[:3, :3] = G * self._model.W @ G.T
        move(self._x, u, self._model.wall, dt)
        self._P = A @ self._P @ A.T + Q

    def _condition(self, rho: Array) -> Array:
        x, model = self._x, self._model
        h, slope = expected_ranges(model.wall, x[:3], model.angles)
        H = np.column_stack((slope @ _axes(x)[:3, :3], np.zeros(len(h))))
        variance = model.range_variance(h)
        good = self._gate.passes(np.square(rho - h) / (np.einsum("ij,jk,ik->i", H, self._P, H) + variance))
        if not good.any():
            return np.full(2, np.nan)
        d, self._P, nis = condition(self._P, H[good], rho[good] - h[good], np.diag(variance[good]))
        offset = SE2.pose(SE2.from_pose(x[:3]) @ SE2.exp(d[:3]))[:2] - x[:2]
        step = step_within(model.wall, x[0], x[1], *offset)
        self._x = np.array([*(x[:2] + step * offset), wrapped(x[2] + step * d[2]), x[3] + step * d[3]])
        return np.array([nis, float(good.sum())])


def _axes(x: Array) -> Array:
    """Matrix (4, 4) from (xi, b) to the error of (x_1, x_2, phi, b) at x (4,), to first order."""
    c, s = math.cos(x[2]), math.sin(x[2])
    axes = np.eye(STATES)
    axes[:2, :2] = [[c, -s], [s, c]]
    return axes
