"""A Kalman filter of the error of (x, v) of a Lagrangian system, about where its equations of motion lead.

    x' = v,    D_t v = F(x, v, u) + w,        y = x + noise,

w white with the density q^2 on every component. The state is a point of the tangent bundle, the error e = (a, b) in 2 n
numbers about it, see ``tangent_bundle``. The state is predicted by ``LagrangianSystem.flow``, the error by a
``Propagation``, in which the filters differ. A reading is L = a + noise, the coordinates of y about x, and so linear in
e: all filters condition alike,

    S = H P H' + R,  K = P H' S^-1,  e = K L,  P = (1 - K H) P (1 - K H)' + K R K',        H = (1 0),

after which e is added to the state. R is the variance of noise and rounding. A reading is refused if its L' S^-1 L
exceeds what that of a good one exceeds with the given probability (chi-square, n degrees of freedom), unless ten before
it were refused as well: then the filter is wrong, not the reading, and the reading is used unchanged.

Errors of (x, v) as 2 n numbers, on any manifold, for Kalman filters.

    (x, v) + (a, b) = (q, PT_{x -> q}(v + b)),    q the point with the coordinates a about x,

and (q, w) - (x, v) is that (a, b) again. If a vector is stored as its n components, as rates of joints and body rates
are, the parallel transport keeps the components: equal rates are no error. An ambient vector, whose components are in a
frame that may jump from one point to the next, is transported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.velocity.gain_covariance import Residual
from mathnavi.estimators.velocity.readings import OutlierCounter, innovation, reading_variance
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold
from mathnavi.models.manifold.mission import LagrangianMission

_STEP = 1e-6  # of an error, in its unit, of the difference that stands for a derivative
_FARTHEST = 0.3  # [rad, m] deviation of a position up to which errors are those of coordinates about the state


class StateErrors:
    """Sums and differences of states (size + vector_size,) and errors (2 n,); CutLocusError if none exists."""

    def __init__(self, manifold: Manifold) -> None:
        self._manifold, self._size, self._n = manifold, manifold.size, manifold.dimension
        self._stored = manifold.vector_size == manifold.dimension  # vectors are their components

    def sum(self, state: Array, error: Array) -> Array:
        """State (size + vector_size,): state + error, of ``state`` (size + vector_size,) and ``error`` (2 n,)."""
        x, v = state[: self._size], state[self._size :]
        q = self._manifold.point(x, error[: self._n])
        w = v + self._manifold.vector(x, error[self._n :])
        return np.concatenate([q, self._carried(x, q, w)])

    def difference(self, other: Array, state: Array) -> Array:
        """Error (2 n,) with state + error = other, of states (size + vector_size,)."""
        x, v = state[: self._size], state[self._size :]
        q, w = other[: self._size], other[self._size :]
        b = self._manifold.components(x, self._carried(q, x, w) - v)
        return np.concatenate([self._manifold.coordinates(x, q), b])

    def state_covariance(self, state: Array, P: Array) -> Array:
        """Covariance (size + vector_size, size + vector_size) of the components of a ``state``, from P (2 n, 2 n).

        Where errors are differences of the components, as of joints, it is P; on a curved space, whose points have more
        components than dimensions, it has the rank of P.
        """
        if self._size == self._n and self._stored:
            return P.copy()
        if self._stored:
            x, steps = state[: self._size], _STEP * np.eye(self._n)
            slope = np.eye(len(state), 2 * self._n, self._n - self._size)  # the identity of the vectors
            slope[: self._size] = 0.0
            moved = [self._manifold.point(x, e) - x for e in steps]
            slope[: self._size, : self._n] = np.stack(moved, axis=1) / _STEP
        else:
            steps = _STEP * np.eye(2 * self._n)
            slope = np.stack([self.sum(state, e) - state for e in steps], axis=1) / _STEP
        covariance: Array = slope @ P @ slope.T
        return 0.5 * (covariance + covariance.T)

    def turned(self, P: Array, x: Array, q: Array) -> Array:
        """Covariance (2 n, 2 n) of errors in the components at q (size,), from P (2 n, 2 n) in those at x (size,)."""
        if self._stored:
            return P
        frame = [self._manifold.vector(x, axis) for axis in np.eye(self._n)]
        rotation = np.stack([self._manifold.components(q, self._carried(x, q, axis)) for axis in frame], axis=1)
        both = np.kron(np.eye(2), rotation)
        turned: Array = both @ P @ both.T
        return turned

    def _carried(self, p: Array, q: Array, w: Array) -> Array:
        """Vector w at p, carried to q."""
        return w if self._stored else self._manifold.transport(p, q, w)


@dataclass(frozen=True)
class FilterModel:
    """Error model of a filter."""

    acceleration: float  # q [rad/s^1.5, m/s^1.5]
    noise_floor: float  # [rad, m] least standard deviation that is assumed for a reading
    gate: float  # probability that a good reading is refused


class Propagation(Protocol):
    """Propagation of a covariance by a map of errors."""

    def __call__(self, errors: Callable[[Array], Array], P: Array) -> tuple[Array, Array]:
        """Mean (2 n,) and covariance (2 n, 2 n) of errors(e), e of mean zero and covariance P; errors(0) = 0."""
        ...


class ErrorStateFilter:
    """A ``VelocityLaw``; ``nis`` (2,) among its arrays is L' S^-1 L and n."""

    def __init__(
        self,
        model: FilterModel,
        mission: LagrangianMission,
        propagation: Propagation,
        far: Propagation | None = None,
    ) -> None:
        """``far`` takes the place of ``propagation`` for errors that reach far in a step, as unknown velocities do."""
        self._model, self._mission, self._propagation = model, mission, propagation
        self._far = far or propagation
        self._system, self._manifold = mission.system, mission.system.manifold
        self._n = self._manifold.dimension
        self._bundle, self._limit = StateErrors(self._manifold), float(chdtri(self._n, model.gate))
        self.covariance = np.full((2 * self._n, 2 * self._n), np.nan)  # P, of e
        self._variance: Array | None = None  # (n,) of a reading, if it is not the declared one
        self._nis = math.nan
        self.residual: Residual | None = None

    @property
    def state(self) -> Array:
        """State (size + vector_size,) (x, v)."""
        return self._state

    settling, doubt = 0.0, ""

    @property
    def state_covariance(self) -> Array | None:
        """Covariance (size + vector_size, size + vector_size) of the state; None before the start."""
        P = self.covariance
        return None if np.isnan(P[0, 0]) else self._bundle.state_covariance(self._state, P)

    @property
    def extra(self) -> Mapping[str, Array]:
        """``nis`` (2,), L' S^-1 L and n."""
        return {"nis": np.array([self._nis, math.nan if math.isnan(self._nis) else float(self._n)])}

    @property
    def deviation(self) -> Array:
        """Standard deviations (2 n,) of e."""
        return np.sqrt(np.diag(self.covariance))

    def start(self, y: Array) -> None:
        """Start at a first reading y (size,), with its variance and that of a velocity of the mission's maximum."""
        manifold = self._manifold
        self._state = np.concatenate([y, np.zeros(manifold.vector_size)])
        variance = reading_variance(self._mission, y) if self._variance is None else self._variance
        self._R = np.maximum(variance, self._model.noise_floor**2)
        velocity = np.full(self._n, self._mission.speed_max**2)
        self.covariance = np.diag(np.concatenate([self._R, velocity]))
        self._outlier_counter, self._nis, self.residual = OutlierCounter(), math.nan, None

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume these errors of a reading from now on."""
        self._variance = variance
        self._R = np.maximum(variance, self._model.noise_floor**2)

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        """Predict over h [s] with u (nu,) held.

        Raises CutLocusError or LinAlgError if the prediction fails.
        """
        bundle, before = self._bundle, self._state
        after = self._system.flow(before, u, h)

        def errors(e: Array) -> Array:
            return bundle.difference(self._system.flow(bundle.sum(before, e), u, h), after)

        propagation = self._far if self._reach(h) > _FARTHEST else self._propagation
        mean, P = propagation(errors, self.covariance)
        self._put(after, mean, P + acceleration_noise(self._model.acceleration, self._n, h))
        self._nis = math.nan

    def _reach(self, h: float) -> float:
        """Greatest standard deviation [rad, m] to which the errors of a position can grow in h [s]."""
        position, velocity = np.split(np.sqrt(np.diag(self.covariance)), 2)
        return float((position + h * velocity).max())

    def correct(self, y: Array, h: float) -> bool:
        """Condition on a reading y (size,), h [s] after the last that was used; True if it was used."""
        n, P = self._n, self.covariance
        L = innovation(self._manifold, self._state[: self._manifold.size], y)
        self.residual = None
        if L is None:
            return self._beyond(y)
        R = np.diag(self._R)
        solved = np.linalg.solve(P[:n, :n] + R, np.column_stack([P[:n], L]))  # S^-1 (H P, L)
        gain = solved[:, :-1].T
        self._nis = float(L @ solved[:, -1])
        used = self._outlier_counter.admits(self._nis <= self._limit)
        self.residual = Residual(L, P.diagonal()[:n].copy(), gain.diagonal().copy(), used)
        if not used:
            return False
        kept = np.eye(2 * n)
        kept[:, :n] -= gain
        self._put(self._state, gain @ L, kept @ P @ kept.T + gain @ R @ gain.T)
        return True

    def _beyond(self, y: Array) -> bool:
        """Handle a reading that has no coordinates: it is refused; if that lasts, the filter starts at it."""
        if not self._outlier_counter.admits(False):
            return False
        self.start(y)
        return True

    def _put(self, state: Array, error: Array, P: Array) -> None:
        """Add the error to the state and transform P to the components there; LinAlgError if it is not finite."""
        if not np.isfinite(P).all():
            raise np.linalg.LinAlgError("the covariance of the errors is not finite")
        size = self._manifold.size
        self._state = self._bundle.sum(state, error) if error.any() else state
        P = self._bundle.turned(P, state[:size], self._state[:size])
        self.covariance = 0.5 * (P + P.T)


def acceleration_noise(density: float, n: int, h: float) -> Array:
    """Covariance Q (2 n, 2 n) over h [s] of white acceleration with the square root ``density`` of its density on each
    axis.
    """
    block = np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]])
    every = block[:, np.newaxis, :, np.newaxis] * np.eye(n)[np.newaxis, :, np.newaxis, :]
    Q: Array = density**2 * every.reshape(2 * n, 2 * n)
    return Q


def filter_properties(note: str) -> ObserverProperties:
    """Properties (Table 2.1) of any of these filters: the gain, and with it the error, falls from its initial value."""
    return ObserverProperties(
        Domain.LOCAL, Rate.ASYMPTOTIC, InputDependence.SEMI_UNIFORM, Domain.LOCAL, Domain.GLOBAL, note=note
    )
