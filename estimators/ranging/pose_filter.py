"""Common part of the extended Kalman filters of a pose: one Gaussian, conditioned on the rays of a reading.

State, motion and errors are those of ``kalman_kernels``. If the start is unknown a filter begins at the centre with the
covariance of a pose that may be anywhere, and within a polygon where a bank has found the pose.

Within a polygon a ray jumps at corners, where a filter that linearises follows the wrong wall: there the update is that
of ``wall_choice_kernels``, in which the probability that a good range is refused is the share of outliers where fewer
are declared, and the estimate is that of a map (``map_fit``).

**filterpy's extended Kalman filter for a robot that reads ranges**: the baseline of the other filters.

It does not account for linearisation errors.

**The plug-in ``range_iekf``**: the invariant extended Kalman filter on SE(2) of a robot that reads ranges.

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
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from mathnavi.estimators.integrity.guard import COST, Guarded
from mathnavi.estimators.integrity.ranging import guarded
from mathnavi.estimators.invariant.lie_groups import SE2
from mathnavi.estimators.kalman_steps import condition, external_prediction_ekf
from mathnavi.estimators.ranging.feasible_set_bank import pose_finder
from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.map_fit import MapFit
from mathnavi.estimators.ranging.model import FROM_WHERE, STATES, Flags, Gate, RangeModel, chi_square_gate
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.estimators.timeout_monitor import waiting
from mathnavi.interfaces.bounds import Positive, Probability, configuration
from mathnavi.interfaces.innovations import published, write_innovations
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.unicycle.kernels import integrate_jacobians, wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality


@configuration
class PoseFilterConfig:
    """Fields of the command line."""

    kernels: ClassVar[str] = "mathnavi.estimators.ranging.pose_ahead"  # compiled before the first run

    gate: Probability = 1e-4
    """probability that a good range is refused"""
    timeout: Positive = 0.5
    """time without a range after which the estimate is lost [s]"""


class PoseFilter(ABC):
    """An estimator of the pose from ranges and odometry, whose errors are linearised about the estimate."""

    Config: ClassVar[type[PoseFilterConfig]] = PoseFilterConfig
    cost = COST
    """CPU time of an update [s], about"""

    def __init__(self, config: PoseFilterConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._model, self._reader = RangeModel(mission), RangeReader(mission, config.timeout)
        self._gate = Gate(config.gate, mission.sensors, self._reader.counts)
        self._fit = MapFit(mission)
        self._sensors = self._model.sensors(chi_square_gate(config.gate))
        self._sensors = self._sensors.noisier(1.0, max(self._model.outliers, config.gate))
        self._t = mission.begins  # [s] of the filter's state; None before the first call
        self._innovations = self._fit.innovations.tested  # (2, l) [m] of the last call, and their deviations

    @classmethod
    def build(cls, config: PoseFilterConfig, mission: RangingMission) -> Guarded:
        """Build the estimator of one run, with its monitor of integrity."""
        finder = partial(pose_finder, timeout=config.timeout)
        return guarded(partial(cls, config), mission, finder=finder, cost=cls.cost)

    @staticmethod
    def sensors(config: PoseFilterConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: PoseFilterConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: PoseFilterConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            domain_of_attraction=Domain.LOCAL,
            rate=Rate.ASYMPTOTIC,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            note=FROM_WHERE,
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) replaces missing odometry.

        ``extra["nis"]`` (2,) is NIS and the number of rays in it, NaN where there was no update;
        ``extra["innovations"]`` (l,) [m] and ``extra["innovation_std"]`` (l,) [m] are those of the rays
        (``interfaces.innovations``); ``extra`` also counts the readings that were not used, by ray.
        """
        reader = self._reader
        rho, u = reader.read(t, measurements, command)
        self._predict(u, 0.0 if self._t is None else max(t - self._t, 0.0))
        self._t = t
        nis = self._condition_among_walls(rho) if self._fit.has_corners else self._condition(rho)
        reader.note(t, self._gate.agrees(reader.converged))
        x, P = self._state()
        P = self._fit.inflation * P[:3, :3]
        status = self._fit.judged(reader.status(t, P))
        extra = {"nis": nis, **published(self._innovations), **reader.counts.extra}
        message = waiting(status, "ranges") or reader.message or self._fit.doubt
        return Estimate(t, x[:3].copy(), P, status, extra, message)

    def _condition_among_walls(self, rho: Array) -> Array:
        """``_condition`` within a polygon; the gate learns of outliers there, and refuses nothing."""
        (x, P), innovations = self._state(), self._fit.innovations
        nis, rays = self._fit.condition(x, P, rho, self._model.wall, self._sensors)
        if rays == 0:
            return np.full(2, np.nan)
        self._gate.passed(np.square(innovations.residual) * innovations.share / innovations.variance)
        self._set_state(x, P)
        return np.array([nis, float(rays)])

    @abstractmethod
    def _state(self) -> tuple[Array, Array]:
        """Copies of the state (4,) and of the symmetric covariance (4, 4) of its error."""

    @abstractmethod
    def _set_state(self, x: Array, P: Array) -> None:
        """Continue at a state (4,) whose error has the covariance P (4, 4)."""

    @abstractmethod
    def _predict(self, u: Array, dt: float) -> None:
        """Predict over dt [s] by the odometry u (2,)."""

    @abstractmethod
    def _condition(self, rho: Array) -> Array:
        """Condition on the ranges rho (l,) that were read and are within the gate; return NIS and their number (2,).

        Tests them by ``_passes``.
        """

    def _passes(self, nu: Array, S: Array) -> Flags:
        """True (l,) where a ray is to be used, by its innovation nu (l,) [m] and the variance S (l,) [m^2] of that."""
        write_innovations(self._innovations, nu, S)
        return self._gate.passes(np.square(nu) / S)


class RangeEkf(PoseFilter):
    """Estimator of the pose from ranges and odometry: one extended Kalman filter."""

    def __init__(self, config: PoseFilterConfig, mission: RangingMission) -> None:
        super().__init__(config, mission)
        self._filter = external_prediction_ekf(STATES, mission.sensors)
        self._filter.x, self._filter.P = self._model.start()

    def _state(self) -> tuple[Array, Array]:
        return self._filter.x.copy(), symmetric(self._filter.P)

    def _set_state(self, x: Array, P: Array) -> None:
        self._filter.x, self._filter.P = x, P

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
        h, H = expected_ranges(model.wall, x[:3], model.rays)
        H = np.column_stack((H, np.zeros(len(h))))
        variance = model.range_variance(h)
        good = self._passes(rho - h, np.einsum("ij,jk,ik->i", H, self._filter.P, H) + variance)
        if not good.any():
            return np.full(2, np.nan)
        R = np.diag(variance[good])
        self._filter.update(rho[good], lambda _: H[good], lambda _: h[good], R=R)
        step = step_within(model.wall, x[0], x[1], *(self._filter.x - x)[:2])
        self._filter.x = x + step * (self._filter.x - x)
        self._filter.x[2] = wrapped(self._filter.x[2])
        y = self._filter.y
        return np.array([y @ self._filter.SI @ y, len(y)])


class RangeIekf(PoseFilter):
    """Estimator of the pose from ranges and odometry: one invariant extended Kalman filter on SE(2)."""

    def __init__(self, config: PoseFilterConfig, mission: RangingMission) -> None:
        super().__init__(config, mission)
        self._x, P = self._model.start()
        axes = _axes(self._x)
        self._P = axes.T @ P @ axes  # of (xi, b)

    def _state(self) -> tuple[Array, Array]:
        axes = _axes(self._x)
        return self._x.copy(), symmetric(axes @ self._P @ axes.T)

    def _set_state(self, x: Array, P: Array) -> None:
        axes = _axes(x).T  # whose inverse is its transpose
        self._x, self._P = x, axes @ P @ axes.T

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
        h, slope = expected_ranges(model.wall, x[:3], model.rays)
        H = np.column_stack((slope @ _axes(x)[:3, :3], np.zeros(len(h))))
        variance = model.range_variance(h)
        good = self._passes(rho - h, np.einsum("ij,jk,ik->i", H, self._P, H) + variance)
        if not good.any():
            return np.full(2, np.nan)
        d, self._P, nis = condition(self._P, H[good], rho[good] - h[good], np.diag(variance[good]))
        offset = SE2.pose(SE2.from_pose(x[:3]) @ SE2.exp(d[:3]))[:2] - x[:2]
        step = step_within(model.wall, x[0], x[1], *offset)
        self._x = np.array([*(x[:2] + step * offset), wrapped(x[2] + step * d[2]), x[3] + step * d[3]])
        return np.array([nis, float(good.sum())])


def symmetric(P: Array) -> Array:
    """The symmetric part (n, n) of a covariance, in the order of C."""
    half: Array = np.ascontiguousarray(0.5 * (P + P.T))
    return half


def _axes(x: Array) -> Array:
    """Matrix (4, 4) from (xi, b) to the error of (x_1, x_2, phi, b) at x (4,), to first order."""
    c, s = math.cos(x[2]), math.sin(x[2])
    axes = np.eye(STATES)
    axes[:2, :2] = [[c, -s], [s, c]]
    return axes
