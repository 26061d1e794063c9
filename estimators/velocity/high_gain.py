"""The plug-in ``high_gain``: the Euclidean high-gain observer, with a model, in the coordinates of the encoders.

    x^' = v^ + 2 omega (y - x^),    v^' = a(x^, v^, u) + omega^2 (y - x^),

where a is the acceleration of the coordinates. It uses no metric: it has no parallel transport and no curvature term.
The acceleration is never computed: between readings (x^, v^) follows x^' = v^, v^' = a by ``LagrangianSystem.flow``,
and at a reading, h after the one before, both poles are placed at e^(-omega h), so that it is stable at any rate of
readings:

    x^ = x^- + alpha L,    v^ = v^- + beta L,    L = y - x^-,

    alpha = 1 - e^(-2 omega h),    beta = (1 - e^(-omega h))^2 / h.

These are the coordinates about x^-: those of joints are the same about any point; on a curved space they are the best
chart, as it is centred at the observer's position. The derivative of the change of coordinates takes v^ from them to
the coordinates about x^.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mathnavi.estimators.velocity.poles import pole_weights
from mathnavi.estimators.velocity.position_observer import GatedLaw, PositionObserver
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import NOTHING, Array
from mathnavi.models.manifold.manifold import Manifold
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import MODEL_FREE_ESTIMATORS, require_modelled

_STEP = 1e-6  # [rad, m] of the difference that stands for a derivative


@configuration
class HighGainConfig:
    """Fields of ``--estimator``."""

    bandwidth: Positive = 10.0
    """bandwidth omega [1/s]; the observer has a double pole at -omega"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class HighGain:
    """Euclidean high-gain observer."""

    Config = HighGainConfig

    @staticmethod
    def build(config: HighGainConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run. Raises FieldError for a system with parts that are not modelled."""
        require_modelled(mission.system, "estimator = high_gain", MODEL_FREE_ESTIMATORS)
        return PositionObserver(_HighGain(config, mission), mission, config.timeout)

    @staticmethod
    def sensors(config: HighGainConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: HighGainConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: HighGainConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.SEMI_UNIFORM, Domain.LOCAL, Domain.GLOBAL,
            note="the bandwidth has to exceed the derivative of the acceleration by the velocity; the observer "
            "has to stay within the range of the coordinates about the system",
        )  # fmt: skip


class _HighGain(GatedLaw):
    """A ``VelocityLaw``."""

    extra: Mapping[str, Array] = NOTHING

    def __init__(self, config: HighGainConfig, mission: LagrangianMission) -> None:
        super().__init__(mission, config.bandwidth)
        self._system, self._bandwidth = mission.system, config.bandwidth

    def _predict(self, h: float, u: Array) -> None:
        self._state = self._system.flow(self._state, u, h)

    def _weights(self, h: float) -> tuple[float, float, float]:
        return *pole_weights(self._bandwidth, 1.0, h), 0.0

    def _corrected(self, x: Array, v: Array, L: Array, weights: tuple[float, float, float]) -> Array:
        alpha, beta, _ = weights
        return _recentred(self._manifold, x, alpha * L, self._manifold.components(x, v) + beta * L)


def _recentred(manifold: Manifold, p: Array, c: Array, rate: Array) -> Array:
    """State (x, v) of a point with coordinates c (n,) about p that change at ``rate`` (n,)."""
    x = manifold.point(p, c)
    ds = _STEP / max(1.0, float(np.abs(rate).max()))  # [s]
    before, after = (manifold.coordinates(x, manifold.point(p, c + s * rate)) for s in (-ds, ds))
    return np.concatenate([x, manifold.vector(x, (after - before) / (2.0 * ds))])
