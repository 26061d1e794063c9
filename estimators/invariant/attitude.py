"""The plug-in ``attitude_iekf``: the invariant extended Kalman filter on SO(3) of a body without a gyro.

    R' = R omega^,   omega' = F(R, omega, u) + w,   y = R Exp(n),   n of variance sigma^2 about each axis.

The attitude's error is left-invariant, R = R^ Exp(xi), and the rate's is that of its components in the body's own axes.
A reading is then linear, nu = Log(R^' y) = xi + n to first order at every R^, and over h, in which the estimate turns
by Log(R^' R^+) = theta,

    xi <- Exp(-theta) xi + h J_r(theta) domega,    domega <- the derivative of the flow's rate by xi and omega,

the latter by differences: the attitude enters it through the forces only. For a body with the same inertia about every
axis it does not enter at all, and the propagation does not depend on it.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.invariant.lie_groups import SO3
from mathnavi.estimators.velocity.error_state import (
    ErrorStateFilter,
    FilterModel,
    acceleration_noise,
    filter_properties,
)
from mathnavi.estimators.velocity.kalman import LagrangianEkf, LagrangianEkfConfig, linearised
from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import MODEL_FREE_ESTIMATORS, require_modelled

_N = 3
_STEP = 1e-6  # [rad, rad/s] of a difference


class AttitudeIekf(LagrangianEkf):
    """The invariant extended Kalman filter of a body's attitude and rate."""

    @staticmethod
    def build(config: LagrangianEkfConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run.

        Raises FieldError for a system that is not a single rotating body, and for one with parts that are not modelled.
        """
        require_modelled(mission.system, "estimator = attitude_iekf", MODEL_FREE_ESTIMATORS)
        return PositionObserver(_AttitudeFilter(config, mission), mission, config.timeout)

    @staticmethod
    def properties(config: LagrangianEkfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return filter_properties("as far as the linearisations of the forces and of a reading hold")


class _AttitudeFilter(ErrorStateFilter):
    """A ``VelocityLaw`` of the errors (xi, omega); ``nis`` (2,) among its arrays is nu' S^-1 nu and 3."""

    def __init__(self, config: LagrangianEkfConfig, mission: LagrangianMission) -> None:
        manifold = mission.system.manifold
        if (manifold.size, manifold.vector_size, manifold.dimension) != (4, _N, _N):
            raise FieldError(f"system = one on {manifold.name}; allowed: a rotating body with a quaternion")
        super().__init__(FilterModel(config.acceleration, config.noise_floor, config.gate), mission, linearised)

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        """Predict over h [s] with the input u (nu,) held.

        Raises CutLocusError where the body turns by half a turn or more.
        """
        before = self._state
        after = self._system.flow(before, u, h)
        theta = self._manifold.coordinates(before[:4], after[:4])
        rates = self._rate_slope(before, after, u, h)
        A = np.vstack([np.hstack([SO3.exp(-theta), h * SO3.right_jacobian(theta)]), rates])
        P = A @ self.covariance @ A.T + acceleration_noise(self._model.acceleration, _N, h)
        self._put(after, np.zeros(2 * _N), P)
        self._nis = math.nan

    def _put(self, state: Array, error: Array, P: Array) -> None:
        """Add the error to the state; P is in the body's axes, and so does not change with the attitude."""
        if not np.isfinite(P).all():
            raise np.linalg.LinAlgError("the covariance of the errors is not finite")
        x = self._manifold.point(state[:4], error[:_N]) if error.any() else state[:4]
        self._state = np.concatenate([x, state[4:] + error[_N:]])
        self.covariance = 0.5 * (P + P.T)

    def _rate_slope(self, before: Array, after: Array, u: Array, h: float) -> Array:
        """Derivative (3, 6) of the rate after h [s] by the error (xi, omega) before, by one-sided differences."""
        x, v = before[:4], before[4:]
        steps = _STEP * np.eye(_N)
        moved = [np.concatenate([self._manifold.point(x, e), v]) for e in steps]
        moved += [np.concatenate([x, v + e]) for e in steps]
        slope: Array = np.column_stack([self._system.flow(each, u, h)[4:] - after[4:] for each in moved]) / _STEP
        return slope
