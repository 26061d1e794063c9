"""filterpy's unscented Kalman filter for a robot that reads ranges.

State, motion and errors are those of ``kalman_kernels``. Headings are averaged on the circle and their differences
wrapped. A sigma point outside the wall, where there are no ranges, gets the ranges at the last point within the wall on
its way from the mean. That and round-off can make a covariance indefinite: the nearest positive definite one is then
used. Within a polygon only predictions are unscented: about a jump of a range the sigma points have no mean that any
pose reads (``pose_filter``).
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from mathnavi.estimators.kalman_steps import square_root
from mathnavi.estimators.ranging.kalman_kernels import expected_ranges, move, step_within
from mathnavi.estimators.ranging.model import FROM_WHERE, STATES
from mathnavi.estimators.ranging.pose_filter import PoseFilter, PoseFilterConfig, symmetric
from mathnavi.interfaces.bounds import FINITE, NonNegative, Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import integrate_jacobians, wrapped
from mathnavi.models.unicycle.mission import RangingMission


@configuration
class RangeUkfConfig(PoseFilterConfig):
    """Fields of the command line."""

    alpha: Positive = 0.5
    """spread of the sigma points of van der Merwe's scaled set"""
    beta: NonNegative = 2.0
    """weight of the centre in the covariance of van der Merwe's scaled set; 2 for a Gaussian"""
    kappa: Annotated[float, Gt(-STATES), FINITE] = 0.0
    """secondary scaling of van der Merwe's scaled set"""


class RangeUkf(PoseFilter):
    """Estimator of the pose from ranges and odometry: one unscented Kalman filter."""

    Config = RangeUkfConfig
    cost = 8e-4

    def __init__(self, config: RangeUkfConfig, mission: RangingMission) -> None:
        super().__init__(config, mission)
        self._filter = self._made(config)
        self._filter.x, self._filter.P = self._model.start()
        self._filter.Q = np.zeros((STATES, STATES))

    @staticmethod
    def properties(config: PoseFilterConfig) -> ObserverProperties:
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

    def _state(self) -> tuple[Array, Array]:
        U = square_root(self._filter.P)
        return self._filter.x.copy(), symmetric(U.T @ U)

    def _set_state(self, x: Array, P: Array) -> None:
        self._filter.x, self._filter.P = x, P

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
        good = self._passes(rho - mean, np.diag(S))
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
