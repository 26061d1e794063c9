"""The Kalman filters of ``error_state``: the plug-ins ``lagrangian_ekf`` and ``lagrangian_ukf``.

**Extended**: the covariance is propagated by P = A P A', where A is the Jacobian of the errors' flow, by one-sided
differences.

**Unscented**: mean and covariance are propagated by sigma points of the error, van der Merwe's scaled set (filterpy's),
so that they are averaged in the coordinates about where the state leads and never as points of the manifold. With
alpha >= 0.52 no weight of the covariance is negative, and it stays positive definite by itself. While the errors reach
farther than the coordinates about the state hold, as at the start, where the velocity is not known, the points say
nothing of their distribution, and the covariance is propagated by the Jacobian.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mathnavi.estimators.kalman_steps import square_root
from mathnavi.estimators.velocity.error_state import ErrorStateFilter, FilterModel, filter_properties
from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.interfaces.bounds import FINITE, Positive, Probability, configuration
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import MODEL_FREE_ESTIMATORS, require_modelled

_STEP = 1e-6  # of an error, in its unit


@configuration
class LagrangianEkfConfig:
    """Fields of ``--estimator``."""

    acceleration: Positive = 0.1
    """square root of the density of the acceleration that the model lacks, per coordinate [rad/s^1.5, m/s^1.5]"""
    noise_floor: Positive = 1e-4
    """least standard deviation that the filter assumes for a reading [rad, m]"""
    gate: Probability = 1e-4
    """probability that a good reading is refused"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class LagrangianEkf:
    """The extended Kalman filter for any Lagrangian system."""

    Config = LagrangianEkfConfig

    @staticmethod
    def build(config: LagrangianEkfConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run. Raises FieldError for a system with parts that are not modelled."""
        require_modelled(mission.system, "estimator = lagrangian_ekf", MODEL_FREE_ESTIMATORS)
        model = FilterModel(config.acceleration, config.noise_floor, config.gate)
        return PositionObserver(ErrorStateFilter(model, mission, linearised), mission, config.timeout)

    @staticmethod
    def sensors(config: LagrangianEkfConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: LagrangianEkfConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: LagrangianEkfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return filter_properties("as far as the linearisation holds")


def linearised(errors: Callable[[Array], Array], P: Array) -> tuple[Array, Array]:
    """Propagate P (2 n, 2 n) by the Jacobian A of ``errors``: mean zero (2 n,) and A P A' (2 n, 2 n); a
    ``Propagation``.
    """
    axes = np.eye(len(P))
    A = np.stack([errors(_STEP * axis) for axis in axes], axis=1) / _STEP
    return np.zeros(len(P)), A @ P @ A.T


_BETA = 2.0  # of a Gaussian
_KAPPA = 0.0  # secondary scaling
_LEAST_ALPHA = 0.52  # above sqrt(2 - sqrt(3)), where the weight 4 - 1 / alpha^2 - alpha^2 of the centre is zero


@configuration
class LagrangianUkfConfig:
    """Fields of ``--estimator``."""

    acceleration: Positive = 0.1
    """square root of the density of the acceleration that the model lacks, per coordinate [rad/s^1.5, m/s^1.5]"""
    alpha: Annotated[float, Interval(ge=_LEAST_ALPHA, le=1.0), FINITE] = 0.6
    """spread of the sigma points"""
    noise_floor: Positive = 1e-4
    """least standard deviation that the filter assumes for a reading [rad, m]"""
    gate: Probability = 1e-4
    """probability that a good reading is refused"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class LagrangianUkf:
    """The unscented Kalman filter for any Lagrangian system."""

    Config = LagrangianUkfConfig

    @staticmethod
    def build(config: LagrangianUkfConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run. Raises FieldError for a system with parts that are not modelled."""
        require_modelled(mission.system, "estimator = lagrangian_ukf", MODEL_FREE_ESTIMATORS)
        model = FilterModel(config.acceleration, config.noise_floor, config.gate)
        unscented = Unscented(2 * mission.system.manifold.dimension, config.alpha)
        return PositionObserver(ErrorStateFilter(model, mission, unscented, linearised), mission, config.timeout)

    @staticmethod
    def sensors(config: LagrangianUkfConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: LagrangianUkfConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: LagrangianUkfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return filter_properties(
            "as far as the sigma points represent the distribution; their mean, and so the estimate, has a bias of "
            "second order in the covariance"
        )


class Unscented:
    """A ``Propagation`` of errors (d,)."""

    def __init__(self, d: int, alpha: float) -> None:
        from filterpy.kalman import MerweScaledSigmaPoints  # takes 0.7 s to import

        self._points = MerweScaledSigmaPoints(d, alpha, _BETA, _KAPPA, sqrt_method=square_root)
        self._centre = np.zeros(d)

    def __call__(self, errors: Callable[[Array], Array], P: Array) -> tuple[Array, Array]:
        Y = np.array([errors(e) for e in self._points.sigma_points(self._centre, P)])  # (2 d + 1, d)
        mean = self._points.Wm @ Y
        deviations = Y - mean
        return mean, deviations.T @ (self._points.Wc[:, np.newaxis] * deviations)
