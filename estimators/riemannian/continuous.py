"""The observer (D.6) in continuous time, on spaces of constant curvature:

    xi' = eta - A G,    D_t eta = -B G + PT_{x -> xi} F + C R(eta, G),    G = grad_xi S = -log_xi x,

D_t eta = eta' + k <xi', eta> xi in the ambient space. It needs the position at every instant, so it is for known
motions, and shows the behaviour of the printed gains; ``sampled`` is for sensors.
"""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature
from mathnavi.models.runge_kutta import classical_step

Instant = tuple[Array, Array]
"""position x (size,) and the force F (size,) there"""


def rates(
    space: ConstantCurvature, gains: IntrinsicGains, instant: Instant, xi: Array, eta: Array
) -> tuple[Array, Array]:
    """Rates xi' (size,) and D_t eta (size,) of the observer at xi, eta (size,), both tangent at xi (D.6)."""
    x, F = instant
    G = -space.log(xi, x)
    theta = space.norm(xi, G)
    drift = eta - gains.position(theta) * G
    curvature = gains.curved(theta) * space.curvature(xi, eta, G)
    return drift, space.transport(x, xi, F) - gains.velocity() * G + curvature


class ContinuousObserver:
    """Observer state (xi, eta), integrated by the Runge-Kutta method of order 4."""

    def __init__(self, space: ConstantCurvature, gains: IntrinsicGains, xi: Array, eta: Array) -> None:
        self._space, self._gains = space, gains
        self.xi, self.eta = space.check(xi), space.tangent(xi, eta)

    def step(self, h: float, begin: Instant, middle: Instant, end: Instant) -> None:
        """Integrate over h [s], in which the system moves from ``begin`` through ``middle`` to ``end``."""
        instants = {0.0: begin, 0.5: middle, 1.0: end}
        z = np.stack([self.xi, self.eta])
        xi, eta = classical_step(lambda z, c: self._slope(instants[c], z), z, h)
        self.xi = self._space.project(xi)
        self.eta = self._space.tangent(self.xi, eta)

    def _slope(self, instant: Instant, z: Array) -> Array:
        """Ambient slope at a stage z that is near the tangent bundle."""
        xi = self._space.project(z[0])
        eta = self._space.tangent(xi, z[1])
        drift, turned = rates(self._space, self._gains, instant, xi, eta)
        normal = self._space.kappa * self._space.inner(xi, drift, eta)
        return np.stack([drift, turned - normal * xi])
