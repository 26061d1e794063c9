"""The plug-in ``lagrangian_ekf``: the extended Kalman filter of ``error_state``.

The covariance is propagated by P = A P A', where A is the Jacobian of the errors' flow, by one-sided differences.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mathnavi.estimators.velocity.error_state import ErrorStateFilter, FilterModel, filter_properties
from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.interfaces.bounds import Positive, Probability, configuration
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission

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
        """Build the estimator of one run."""
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
