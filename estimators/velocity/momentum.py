"""The plug-in ``momentum_observer``: a disturbance observer in generalised momenta (De Luca and Mattone, 2003).

With p = M(q) v and tau_d a torque that the model lacks,

    q' = M^-1 p,    p' = tau(q, v, u) + C(q, v)' v - g(q) + tau_d,    tau_d' = 0.

The observer of De Luca and Mattone reads v and is a low-pass filter of tau_d, r = K (p - int (tau + C' v - g + r) dt).
Here v is not read, so p is estimated as well, and the three errors have one triple pole. Between readings (q^, v^,
tau_d^) follows the model, by ``LagrangianSystem.flow``; at a reading, h after the one before, with rho = e^(-omega h)
and L = y - q^- in the coordinates of the encoders,

    q^ = q^- + alpha L,    p^ = p^- + M beta L,    tau_d^ = tau_d^- + M gamma L,

    alpha = 1 - rho^3,    beta = 3/2 (1 - rho)^2 (1 + rho) / h,    gamma = (1 - rho)^3 / h^2.

``disturbance`` among the extra arrays of the estimate is tau_d^ (nv,) [N m, N].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np

from mathnavi.estimators.velocity.poles import triple_pole_weights
from mathnavi.estimators.velocity.position_observer import GatedLaw, PositionObserver
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import (
    MODEL_FREE_ESTIMATORS,
    LagrangianSystem,
    integrate,
    require_modelled,
    stepped,
)


@configuration
class MomentumObserverConfig:
    """Fields of ``--estimator``."""

    bandwidth: Positive = 30.0
    """bandwidth omega [1/s]; the observer has a triple pole at -omega"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class MomentumObserver:
    """The momentum-based disturbance observer of a mechanism."""

    Config = MomentumObserverConfig

    @staticmethod
    def build(config: MomentumObserverConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run.

        Raises FieldError for a system without a mass matrix, and for one with parts that are not modelled.
        """
        require_modelled(mission.system, "estimator = momentum_observer", MODEL_FREE_ESTIMATORS)
        return PositionObserver(_Momentum(config, mission), mission, config.timeout)

    @staticmethod
    def sensors(config: MomentumObserverConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: MomentumObserverConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: MomentumObserverConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.SEMI_UNIFORM, Domain.LOCAL, Domain.GLOBAL,
            note="the bandwidth has to exceed the derivative of the acceleration by the velocity; a constant torque "
            "that the model lacks leaves no error",
        )  # fmt: skip


@runtime_checkable
class _WithMass(Protocol):
    """Manifold whose metric is a mass matrix in the coordinates of the encoders."""

    def mass(self, p: Array) -> Array:
        """Mass matrix (n, n) at p (size,)."""
        ...


class _Disturbed:
    """A ``LagrangianSystem`` with one more torque, for ``integrate``."""

    def __init__(self, system: LagrangianSystem, mass: _WithMass) -> None:
        self._system, self._mass = system, mass
        self.manifold: Manifold = system.manifold
        self.states, self.inputs = system.states, system.inputs
        self.constant, self.amplitude = system.constant, system.amplitude
        self.velocity_dependent = system.velocity_dependent
        self.torque: Array = np.zeros(system.manifold.dimension)
        self._stepped = stepped(system)

    def acceleration(self, x: Array) -> Array:
        """Acceleration M^-1 tau_d (n,) at x (size,)."""
        return np.asarray(np.linalg.solve(self._mass.mass(x), self.torque), dtype=np.float64)

    def force(self, x: Array, v: Array, u: Array) -> Array:
        return self._system.force(x, v, u) + self.acceleration(x)

    def flow(self, state: Array, u: Array, h: float) -> Array:
        if self._stepped is None:
            return integrate(self, state, u, h)
        x, v = state[: self.manifold.size], state[self.manifold.size :]
        return np.concatenate(self._stepped.step(x, v, u, h, self.acceleration(x)))


class _Momentum(GatedLaw):
    """A ``VelocityLaw``."""

    def __init__(self, config: MomentumObserverConfig, mission: LagrangianMission) -> None:
        super().__init__(mission, config.bandwidth)
        manifold = mission.system.manifold
        if not isinstance(manifold, _WithMass) or manifold.vector_size != manifold.dimension:
            raise FieldError(f"system = {manifold.name!r}; allowed for momentum_observer: a mechanism")
        self._mass: _WithMass = manifold
        self._bandwidth, self._system = config.bandwidth, _Disturbed(mission.system, manifold)

    @property
    def extra(self) -> Mapping[str, Array]:
        return {"disturbance": self._system.torque.copy()}

    def start(self, y: Array) -> None:
        super().start(y)
        self._system.torque = np.zeros(self._manifold.dimension)

    def _predict(self, h: float, u: Array) -> None:
        self._state = self._system.flow(self._state, u, h)

    def _weights(self, h: float) -> tuple[float, float, float]:
        alpha, beta, gamma = triple_pole_weights(self._bandwidth, h)
        return float(alpha), float(beta), float(gamma)

    def _corrected(self, x: Array, v: Array, L: Array, weights: tuple[float, float, float]) -> Array:
        alpha, beta, gamma = weights
        M = self._mass.mass(x)
        after = self._manifold.point(x, alpha * L)
        self._system.torque = self._system.torque + gamma * (M @ L)
        return np.concatenate([after, np.linalg.solve(self._mass.mass(after), M @ (v + beta * L))])
