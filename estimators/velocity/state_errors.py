"""Errors of (x, v) as 2 n numbers, on any manifold, for Kalman filters.

    (x, v) + (a, b) = (q, PT_{x -> q}(v + b)),    q the point with the coordinates a about x,

and (q, w) - (x, v) is that (a, b) again. If a vector is stored as its n components, as rates of joints and body rates
are, the parallel transport keeps the components: equal rates are no error. An ambient vector, whose components are in a
frame that may jump from one point to the next, is transported.
"""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold


class StateErrors:
    """Sums and differences of states (size + vector_size,) and errors (2 n,); CutLocusError if there are none."""

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
