"""filterpy's unscented Kalman filter for a robot that reads ranges.

State, motion and errors are those of ``kalman_kernels``. Headings are averaged on the circle and their differences
wrapped. A sigma point outside the wall, where there are no ranges, gets the ranges at the last point within the wall on
its way from the mean. That and round-off can make a covariance indefinite: the nearest positive definite one is then
used. If the start is unknown the filter begins at the centre with the covariance of a pose that may be anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.integrity.ranging import guarded
from mathnavi.estimators.kalman_steps import square_root
from mathnavi.estimators.ranging.feasible_set_bank import pose_finder
from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.model import FROM_WHERE, STATES, Gate, RangeModel
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.estimators.timeout_monitor import waiting
from mathnavi.interfaces.bounds import FINITE, NonNegative, Positive, Probability, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.unicycle.kernels import integrate_jacobians, wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

_COST = 8e-4  # [s] of an update


@configuration
class RangeUkfConfig:
    """Fields of the command line."""

    alpha: Positive = 0.5
    """spread of the sigma points of van der Merwe's scaled set"""
    beta: NonNegative = 2.0
    """weight of the centre in the covariance of van der Merwe's scaled set; 2 for a Gaussian"""
    kappa: Annotated[float, Gt(-STATES), FINITE] = 0.0
    """secondary scaling of van der Merwe's scaled set"""
    gate: Probability = 1e-4
    """probability that a good range is refused"""
    timeout: Positive = 0.5
    """time without a range after which the estimate is lost [s]"""


class RangeUkf:
    """Estimator of the pose from ranges and odometry: one unscented Kalman filter."""

    Config = RangeUkfConfig

    def __init__(self, config: RangeUkfConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._model, self._reader = RangeModel(mission), RangeReader(mission, config.timeout)
        self._gate = Gate(config.gate, mission.sensors, self._reader.counts)
        self._filter = self._made(config)
        self._filter.x, self._filter.P = self._model.start()
        self._filter.Q = np.zeros((STATES, STATES))
        self._t = mission.begins  # [s] of the filter's state; None before the first call

    @staticmethod
    def build(config: RangeUkfConfig, mission: RangingMission) -> Guarded:
        """Build the estimator of one run, with its monitor of integrity."""
        return guarded(partial(RangeUkf, config), mission, finder=pose_finder, cost=_COST)

    @staticmethod
    def sensors(config: RangeUkfConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: RangeUkfConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: RangeUkfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            domain_of_attraction=Domain.LOCAL,
            rate=Rate.ASYMPTOTIC,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.LOCAL,
            system_domain=Domain.GLOBAL,
            stays_on_truth=False,
            note=f"{FROM_WHERE}; its expected reading is a mean over its covariance and differs from the true one "
            "even on the truth; without noise the covariance shrinks, and the error with it",
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) replaces missing odometry.

        ``extra["nis"]`` (2,) is NIS and the number of rays in it, NaN where there was no update; ``extra`` also counts
        the readings that were not used, by ray.
        """
        reader = self._reader
        rho, u = reader.read(t, measurements, command)
        self._predict(u, 0.0 if self._t is None else t - self._t)
        self._t = t
        nis = self._condition(rho)
        reader.note(t, self._gate.agrees(reader.converged))
        U = square_root(self._filter.P)[:, :3]
        P = U.T @ U
        status, extra = reader.status(t, P), {"nis": nis, **reader.counts.extra}
        return Estimate(t, self._filter.x[:3].copy(), P, status, extra, waiting(status, "ranges"))

    def _predict(self, u: Array, dt: float) -> None:
        x = self._filter.x
        _, G = integrate_jacobians(x[:3], (1.0 - x[3]) * u[0], (1.0 - x[3]) * u[1], dt)
        self._filter.Q[:3, :3] = G * self._model.W @ G.T
        self._filter.predict(dt, u=u)
        self._filter.x = self._kept_within(x, self._filter.x)

    def _condition(self, rho: Array) -> Array:
        """Condition on the rays that were read and are within the gate; return NIS and their number."""
        from filterpy.kalman import unscented_transform

        model, x = self._model, self._filter.x.copy()
        h = np.array([self._read(sigma) for sigma in self._filter.sigmas_f])
        R = np.diag(model.range_variance(h[0]))
        mean, S = unscented_transform(h, self._filter.Wm, self._filter.Wc, R)
        good = self._gate.passes(np.square(rho - mean) / np.diag(S))
        if not good.any():
            return np.full(2, np.nan)
        self._filter.update(rho[good], R=R[np.ix_(good, good)], hx=lambda sigma: self._read(sigma)[good])
        self._filter.x = self._kept_within(x, self._filter.x)
        y = self._filter.y
        return np.array([y @ self._filter.SI @ y, len(y)])

    def _read(self, sigma: Array) -> Array:
        """Ranges (l,) [m] from a sigma point (4,)."""
        pose = self._kept_within(self._filter.x, sigma)[:3]
        h, _ = expected_ranges(self._model.wall, pose, self._model.rays)
        return h

    def _kept_within(self, inner: Array, x: Array) -> Array:
        """State x (4,), moved back towards the state ``inner`` (4,) until it is within the wall."""
        step = step_within(self._model.wall, inner[0], inner[1], x[0] - inner[0], x[1] - inner[1])
        kept: Array = x.copy()
        kept[:2] = inner[:2] + step * (x - inner)[:2]
        return kept

    def _made(self, config: RangeUkfConfig) -> Any:
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter  # takes 0.7 s to import

        points = MerweScaledSigmaPoints(
            STATES, config.alpha, config.beta, config.kappa, sqrt_method=square_root, subtract=_difference
        )
        return UnscentedKalmanFilter(
            STATES, len(self._model.angles), self.period, self._read, self._moved, points,
            x_mean_fn=_mean, residual_x=_difference, state_add=_sum,
        )  # fmt: skip

    def _moved(self, sigma: Array, dt: float, u: Array) -> Array:
        after: Array = sigma.copy()
        move(after, u, self._model.wall, dt)
        return after


def _difference(x: Array, y: Array) -> Array:
    difference: Array = np.subtract(x, y)
    difference[2] = wrapped(difference[2])
    return difference


def _sum(x: Array, y: Array) -> Array:
    total: Array = np.add(x, y)
    total[2] = wrapped(total[2])
    return total


def _mean(sigmas: Array, weights: Array) -> Array:
    """Mean of sigma points (2 n + 1, n); the headings relative to the first, around which they lie."""
    return _sum(sigmas[0], weights @ np.array([_difference(sigma, sigmas[0]) for sigma in sigmas]))
