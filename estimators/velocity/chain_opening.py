"""Observer of what closed chains open by, beside what their model says.

A closed chain is soft: the forces in it open it, by a way that the model says as well as it knows the forces. What a
reading says across the chain (``models.mechanism.closed_chains``), n about the model's position, does not move the
model, in which it would be a spring that is wound. It is observed by itself, by a triple integrator,

    o^- = o + h o' + h^2 o'' / 2,    N = n - o^-,    o = o^- + alpha N,    o' + beta N,    o'' + gamma N,

with the weights of three poles (``estimators.velocity.poles``) whose bandwidths the innovations N tune: they begin at
the least, as a chain is stiff until the readings show otherwise. (x, v) of the estimate are those of the model with o
and o' added. Both stay across the chain as it turns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mathnavi.estimators.riemannian.gains import BandwidthTuning
from mathnavi.estimators.velocity.gain_covariance import GainCovariance, Residual
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold
from mathnavi.models.manifold.system import Closure, LagrangianSystem, closure


class Opened(NamedTuple):
    """Correction of an opening for a reading."""

    innovation: Array  # (n,) N [rad, m]
    variance: Array  # (n,) [rad^2, m^2] of the prediction
    moved: Array  # (n,) alpha N


class ChainOpening:
    """Opening of the closed chains of one mechanism."""

    @staticmethod
    def of(system: LagrangianSystem, period: float) -> ChainOpening | None:
        """Observer of a system whose readings are ``period`` [s] apart; None of one without closed chains."""
        chains = closure(system)
        return None if chains is None else ChainOpening(system.manifold, chains, period)

    def __init__(self, manifold: Manifold, chains: Closure, period: float) -> None:
        self._manifold, self._chains, self._period = manifold, chains, period
        self._errors = GainCovariance(manifold.dimension)
        self._o = np.zeros((3, manifold.dimension))  # o, o' and o''
        self._tuning: BandwidthTuning | None = None

    def start(self, variance: Array, steps: Array) -> None:
        """Start closed, with readings of a ``variance`` (n,), of which rounding to ``steps`` (n,) is a part."""
        self._o[:] = 0.0
        self._errors.start(variance, steps, 0.0)
        self._tuning = BandwidthTuning(self._period, variance, steps, slow=True)

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume these errors of a reading from now on."""
        self._errors.learn(variance, steps)
        if self._tuning is not None:
            self._tuning.learn(variance, steps)

    def predict(self, h: float) -> None:
        """Let h [s] pass."""
        self._o[0] += h * self._o[1] + 0.5 * h * h * self._o[2]
        self._o[1] += h * self._o[2]
        self._errors.predict(h)

    def correct(self, x: Array, n: Array, rate: Array, h: float) -> Opened:
        """Condition on what a reading says across the chains, n (n,) about the model's position x (size,), which moves
        at a ``rate`` (n,), h [s] after the reading before.
        """
        assert self._tuning is not None
        self._o -= self._chains.tangent(x, self._o.T).T
        N = n - self._o[0]
        self._tuning.weights(N, rate, h)
        alpha, beta, gamma = self._tuning.common_weights(len(N), h)  # those of one coordinate would turn N
        self._o += np.stack([alpha * N, beta * N, gamma * N])
        self._errors.correct(N, (alpha, beta, gamma), rate, h)
        return Opened(N, self._errors.predicted, alpha * N)

    def added(self, x: Array, v: Array) -> Array:
        """State (size + vector_size,) of a model at x (size,), v (vector_size,) whose chains are open."""
        return np.concatenate([self._manifold.point(x, self._o[0]), v + self._manifold.vector(x, self._o[1])])

    def deviation(self, known: Array) -> Array:
        """Standard deviations (2 n,) of positions and velocities, where those of the model are ``known`` (2 n,)."""
        both: Array = np.hypot(known, self._errors.deviation)
        return both


def residual_of(L: Array, variance: Array, gain: Array, opened: Opened | None) -> Residual:
    """Residual of a reading whose innovation L (n,) moves a model by the ``gain`` (n,), and chains as ``opened``."""
    if opened is None:
        return Residual(L, variance, gain)
    return Residual(L + opened.innovation, variance + opened.variance, gain, moved=gain * L + opened.moved)
