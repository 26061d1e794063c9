"""The observer (D.6) in continuous time, on spaces of constant curvature:

    xi' = eta - A G,    D_t eta = -B G + PT_{x -> xi} F + C R(eta, G),    G = grad_xi S = -log_xi x,

D_t eta = eta' + k <xi', eta> xi in the ambient space. It needs the position at every instant, so it serves where the
motion is known, and shows what the printed gains do; ``sampled`` is for sensors.
"""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.models.manifold.constant_curvature import ConstantCurvature
from mathnavi.sim.interfaces.signals import Array

Instant = tuple[Array, Array]
"""x and the force F there"""


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
    """(xi, eta), moved on by the method of Runge and Kutta of order 4."""

    def __init__(self, space: ConstantCurvature, gains: IntrinsicGains, xi: Array, eta: Array) -> None:
        self._space, self._gains = space, gains
        self.xi, self.eta = space.check(xi), space.tangent(xi, eta)

    def step(self, h: float, begin: Instant, middle: Instant, end: Instant) -> None:
        """Integrate over h [s], in which the system moves from ``begin`` through ``middle`` to ``end``."""
        z = np.stack([self.xi, self.eta])
        k_1 = self._slope(begin, z)
        k_2 = self._slope(middle, z + 0.5 * h * k_1)
        k_3 = self._slope(middle, z + 0.5 * h * k_2)
        k_4 = self._slope(end, z + h * k_3)
        xi, eta = z + (h / 6.0) * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
        self.xi = self._space.project(xi)
        self.eta = self._space.tangent(self.xi, eta)

    def _slope(self, instant: Instant, z: Array) -> Array:
        """Ambient, of a stage that is near the tangent bundle."""
        xi = self._space.project(z[0])
        eta = self._space.tangent(xi, z[1])
        drift, turned = rates(self._space, self._gains, instant, xi, eta)
        normal = self._space.kappa * self._space.inner(xi, drift, eta)
        return np.stack([drift, turned - normal * xi])
