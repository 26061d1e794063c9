"""filterpy's extended Kalman filter for a robot that reads ranges: the yardstick of the other filters.

State, motion and errors are those of ``kalman_kernels``, but for what the linearisation leaves out, which it knows
nothing of. Where the start is unknown it begins at the centre with the covariance of a pose that may be anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.external_prediction_ekf import external_prediction_ekf
from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.model import FROM_WHERE, STATES, Gate, RangeModel
from mathnavi.estimators.timeout_monitor import TimeoutMonitor
from mathnavi.models.unicycle.kernels import integrate_jacobians, wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality
from mathnavi.sim.interfaces.bounds import Positive, Probability, configuration
from mathnavi.sim.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.sim.interfaces.protocols import Sensor
from mathnavi.sim.interfaces.signals import Array, Estimate, Measurement


@configuration
class RangeEkfConfig:
    """Fields of the command line."""

    gate: Probability = 1e-4
    """probability with which a good range is refused"""
    timeout: Positive = 0.5
    """without a range after which the estimate is lost [s]"""


class RangeEkf:
    """Estimator of the pose from ranges and odometry: one extended Kalman filter."""

    Config = RangeEkfConfig

    def __init__(self, config: RangeEkfConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._model, self._timeout_monitor = RangeModel(mission), TimeoutMonitor(config.timeout)
        self._gate = Gate(config.gate, mission.sensors)
        self._filter = external_prediction_ekf(STATES, mission.sensors)
        self._filter.x, self._filter.P = self._model.start()
        self._t: float | None = None  # [s] of the filter's state; None before the first call

    @staticmethod
    def build(config: RangeEkfConfig, mission: RangingMission) -> RangeEkf:
        """Build the estimator of one run."""
        return RangeEkf(config, mission)

    @staticmethod
    def sensors(config: RangeEkfConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: RangeEkfConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: RangeEkfConfig) -> ObserverProperties:
        """Table 2.1."""
        return ObserverProperties(
            domain_of_attraction=Domain.LOCAL,
            rate=Rate.ASYMPTOTIC,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            note=FROM_WHERE,
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) stands in where odometry says nothing.

        ``extra["nis"]`` (2,) is NIS and the number of rays in it, NaN where there was no update.
        """
        rho = self._model.ranges(measurements)
        self._timeout_monitor.note(t, not np.isnan(rho).all())
        if self._t is not None and t > self._t:
            self._predict(self._model.input(measurements, command), t - self._t)
        self._t = t
        nis = self._condition(rho)
        P = self._filter.P[:3, :3]
        return Estimate(t, self._filter.x[:3].copy(), 0.5 * (P + P.T), self._timeout_monitor.status(t), {"nis": nis})

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
        """On the rays that are there and within the gate; NIS and their number."""
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
