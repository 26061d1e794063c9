"""The observer (D.6) between readings and at them, for a sensor of any rate.

Between readings (xi, eta) follows the system's motion, a geodesic bent by the force:

    xi^- = exp_xi(h eta + h^2 F / 2),    eta^- = PT_{xi -> xi^-}(eta + h F / 2) + h F^- / 2,

where F and F^- are the forces at both ends, each transported from the system's measured position to the observer's. At
a reading y, h after the one before, with L = log_{xi^-} y = -grad S,

    xi = exp_{xi^-}(alpha L),    eta = PT_{xi^- -> xi}(eta^- + beta L + h C R(eta^-, -L)),

    alpha = 1 - rho_1 rho_2,  beta = (1 - rho_1)(1 - rho_2) / h,  rho_i = e^(lambda_i h)        constant gains
    alpha = 1 - e^(-A h),  beta = B h                                                  gains that depend on S

where lambda_i are the roots of lambda^2 + A lambda + B: stable for every h on a flat space. On a curved space the
curvature term is stable only while h |eta| is small; a term that would move xi by more than half of |L| in the time h,
as after a gap in the readings, is limited to that. With a disturbance delta that the force lacks, transported like the
velocity, there are three poles at rho = e^(-omega h):

    alpha = 1 - rho^3,  beta = 3/2 (1 - rho)^2 (1 + rho) / h,  delta = delta^- + gamma L,  gamma = (1 - rho)^3 / h^2.

With a ``tuning`` each component has its own omega, see ``gains``. A ``SteppedSystem`` is predicted by its own steps, or
by those of what was learned of it, the disturbance included: (xi^-, eta^-) is the state that they reach from (xi, eta).
Where the system has closed chains, L is what of it they allow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.riemannian.gains import BandwidthTuning, IntrinsicGains
from mathnavi.estimators.velocity.poles import triple_pole_weights
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import is_beyond
from mathnavi.models.manifold.system import LagrangianSystem, Step, SteppedSystem, closure, stepped

_LARGEST = 0.5  # of |L| that the curvature term moves xi by within h


@dataclass(frozen=True)
class Innovation:
    """Innovation of a reading."""

    distance: float  # theta between it and the prediction
    accepted: bool  # whether it was within the share of the injectivity radius
    components: Array | None = None  # (n,) of L, if it was
    weights: tuple[float | Array, float | Array, float | Array] = (0.0, 0.0, 0.0)  # alpha, beta and gamma
    across: Array | None = None  # (n,) components of the reading that closed chains do not allow, and L lacks


class SampledIntrinsicObserver:
    """Observer state (xi, eta) and, if ``disturbed``, delta; starts at the first reading and eta = 0 (Theorem D.2)."""

    def __init__(
        self,
        system: LagrangianSystem,
        gains: IntrinsicGains,
        start: Array,
        *,
        disturbed: bool = False,
        share: float = 1.0,
        tuning: BandwidthTuning | None = None,
    ) -> None:
        """``start`` (size,) is the first reading; a ``tuning`` requires ``disturbed``."""
        self._system, self._manifold, self._gains = system, system.manifold, gains
        by_steps = stepped(system)
        self._step: Callable[..., tuple[Array, Array]] | None = None if by_steps is None else by_steps.step
        self._constraints: SteppedSystem | Step | None = by_steps
        self._tuning = tuning
        self._share = share  # largest distance of a reading, over the injectivity radius
        self._closure = closure(system)
        self.xi = system.manifold.check(start)
        if self._closure is not None:
            self.xi = self._closure.nearest(self.xi)
        self.eta = np.zeros(system.manifold.vector_size)
        self.delta: Array | None = np.zeros(system.manifold.vector_size) if disturbed else None
        self._measured: Array | None = self.xi  # where the system was when it was last read; None once that is old

    def use(self, step: Step) -> None:
        """Predict by another ``step`` from now on, which lacks nothing as far as is known."""
        self._step, self._constraints = step, step
        if self.delta is not None:
            self.delta = np.zeros_like(self.delta)

    @property
    def constraint_acceleration(self) -> Array | None:
        """Acceleration (vector_size,) by which constraints acted in the last step; None of a system without steps."""
        return None if self._constraints is None else self._constraints.constraint_acceleration

    @property
    def touching(self) -> int:
        """Number of constraints of contacts and limits in the last step."""
        return 0 if self._constraints is None else self._constraints.touching

    def predict(self, h: float, u: Array, y: Array | None = None) -> None:
        """Predict over h [s] with the input u (nu,) held; y (size,) is the reading at the end, if there is one."""
        manifold, before = self._manifold, self.xi
        if self._step is not None:
            self.xi, self.eta = self._step(before, self.eta, u, h, self.delta)
            if self.delta is not None:
                self.delta = manifold.transport(before, self.xi, self.delta)
            return
        F = self._force(self._measured, u)
        after = manifold.exp(before, h * self.eta + (0.5 * h * h) * F)
        half = manifold.transport(before, after, self.eta + (0.5 * h) * F)
        if self.delta is not None:
            self.delta = manifold.transport(before, after, self.delta)
        # A velocity-dependent force is evaluated at the velocity that it leads to.
        self.eta = manifold.transport(before, after, self.eta + h * F) if self._system.velocity_dependent else half
        self.xi = after
        self._measured = None if y is None or is_beyond(manifold, after, y, self._share) else y
        self.eta = half + (0.5 * h) * self._force(self._measured, u)

    def correct(self, y: Array, h: float) -> Innovation:
        """Condition on a reading y (size,), h [s] after the one before."""
        manifold, before = self._manifold, self.xi
        theta = manifold.distance(before, y)
        if is_beyond(manifold, before, y, self._share):
            self._measured = None
            return Innovation(theta, accepted=False)
        L = manifold.log(before, y)
        across = None
        if self._closure is not None:  # of a mechanism, whose vectors are their components
            allowed = self._closure.tangent(before, L)
            L, across = allowed, L - allowed
        alpha: float | Array
        beta: float | Array
        gamma: float | Array = 0.0
        if self._tuning is not None:
            alpha, beta, gamma = self._tuning.weights(L, self.eta, h)
        elif self.delta is None:
            alpha, beta = self._gains.weights(theta, h)
        else:
            alpha, beta, gamma = triple_pole_weights(self._gains.bandwidth, h)
        term = self._curvature_term(theta, L, h)
        after = manifold.exp(before, alpha * L)
        self.eta = manifold.transport(before, after, self.eta + beta * L + term)
        if self.delta is not None:
            self.delta = manifold.transport(before, after, self.delta + gamma * L)
        self.xi = after
        return Innovation(theta, True, manifold.components(before, L), (alpha, beta, gamma), across)

    def _curvature_term(self, theta: float, L: Array, h: float) -> Array:
        """h C R(eta, -L), at most _LARGEST |L| / h long."""
        manifold = self._manifold
        term = h * self._gains.curved(theta) * manifold.curvature(self.xi, self.eta, -L)
        size, most = manifold.norm(self.xi, term), _LARGEST * theta / h
        return term if size <= most else term * (most / size)

    def _force(self, measured: Array | None, u: Array) -> Array:
        """Force at xi: that at the measured position, transported to xi, or that at xi itself without a measurement."""
        system, manifold = self._system, self._manifold
        if measured is None:
            F = system.force(self.xi, self.eta, u)
        else:
            v = manifold.transport(self.xi, measured, self.eta) if system.velocity_dependent else self.eta
            F = manifold.transport(measured, self.xi, system.force(measured, v, u))
        return F if self.delta is None else F + self.delta
