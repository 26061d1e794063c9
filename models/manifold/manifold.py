"""Configuration manifolds, as a coordinate-free observer uses them."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array

_ONE_RATE = np.zeros(1, dtype=np.intp)


class CutLocusError(ValueError):
    """Two points that no shortest geodesic joins, or more than one."""


class Manifold(Protocol):
    """A Riemannian manifold X. A point is an array (size,), a tangent vector at it an array (vector_size,)."""

    @property
    def name(self) -> str:
        """Name of the manifold in messages."""
        ...

    @property
    def dimension(self) -> int:
        """Dimension n."""
        ...

    @property
    def size(self) -> int:
        """Length of a point."""
        ...

    @property
    def vector_size(self) -> int:
        """Length of a tangent vector."""
        ...

    @property
    def injectivity_radius(self) -> float:
        """Radius within which points are joined by one shortest geodesic; ``math.inf`` if all are."""
        ...

    @property
    def kappa(self) -> float | None:
        """Sectional curvature if it is the same everywhere; otherwise None."""
        ...

    @property
    def origin(self) -> Array:
        """Some point (size,) of the manifold."""
        ...

    def check(self, p: Array) -> Array:
        """Return the point p (size,) in the form that the other methods take.

        Raises ValueError if p is not a point of the manifold.
        """
        ...

    def exp(self, p: Array, w: Array) -> Array:
        """Exponential map: the point (size,) that the geodesic from p (size,) with the velocity w (vector_size,)
        reaches after 1 s.
        """
        ...

    def log(self, p: Array, q: Array) -> Array:
        """Logarithm: the shortest w (vector_size,) at p (size,) with exp(p, w) = q (size,).

        Raises CutLocusError where no unique one exists.
        """
        ...

    def distance(self, p: Array, q: Array) -> float:
        """Length of the shortest geodesic from p (size,) to q (size,)."""
        ...

    def norm(self, p: Array, w: Array) -> float:
        """|w|_g of a tangent vector w (vector_size,) at p (size,)."""
        ...

    def transport(self, p: Array, q: Array, w: Array) -> Array:
        """Parallel transport of w (vector_size,) at p (size,) along the shortest geodesic to q (size,).

        Returns a vector (vector_size,) at q. Raises CutLocusError where there is no unique geodesic.
        """
        ...

    def curvature(self, p: Array, eta: Array, G: Array) -> Array:
        """Curvature term R(eta, G) eta (vector_size,) at p (size,): R^alpha of (D.6), by the index conventions of
        D.2.1.
        """
        ...

    def coordinates(self, p: Array, q: Array) -> Array:
        """Coordinates (n,) of q (size,) in a chart about p (size,), in the units of an encoder there.

        Raises CutLocusError where the chart does not reach q.
        """
        ...

    def point(self, p: Array, c: Array) -> Array:
        """Point (size,) with the coordinates c (n,) about p (size,)."""
        ...

    def rounded(self, p: Array, bits: int) -> Array:
        """Round p (size,) to encoders of ``bits`` bits over a turn or a metre; 0 bits: no rounding."""
        ...

    def components(self, p: Array, w: Array) -> Array:
        """Components (n,) of a tangent vector w (vector_size,) at p (size,): the rates of the coordinates about p."""
        ...

    def vector(self, p: Array, c: Array) -> Array:
        """Tangent vector (vector_size,) at p (size,) with the components c (n,)."""
        ...


def is_beyond(manifold: Manifold, p: Array, q: Array, share: float = 1.0) -> bool:
    """True if p (size,) and q (size,) are farther apart than a share of the injectivity radius."""
    return manifold.injectivity_radius < math.inf and (manifold.distance(p, q) >= share * manifold.injectivity_radius)


def quaternion_parts(manifold: Manifold) -> tuple[slice, ...]:
    """Places of the unit quaternions in a point; a manifold that has some names them as ``quaternions``."""
    parts: tuple[slice, ...] = getattr(manifold, "quaternions", ())
    return parts


def turn_starts(manifold: Manifold) -> tuple[int, ...]:
    """First of the three components of the rate of each quaternion's attitude; a manifold that has some names them as
    ``turns``.
    """
    starts: tuple[int, ...] = getattr(manifold, "turns", ())
    return starts


def greatest_rate(manifold: Manifold, c: Array) -> float:
    """Greatest rate [rad/s, m/s] of a motion whose components are c (n,); NaN if one of them is.

    It is that of a joint or, of a body that turns or moves freely, the length of its angular or linear velocity. A
    manifold that has several of them names the first component of each as ``rate_starts``; else all are those of one.
    """
    return math.sqrt(float(np.add.reduceat(np.square(c), rate_starts(manifold)).max()))


def rate_starts(manifold: Manifold) -> NDArray[np.intp]:
    """First component of the rate of each joint, and of each turn and way of a body that moves freely."""
    starts: NDArray[np.intp] = getattr(manifold, "rate_starts", _ONE_RATE)
    return starts


def unrounded(name: str, p: Array, bits: int) -> Array:
    """Return p (size,) unchanged, on a manifold without encoders.

    Raises FieldError unless ``bits`` is 0.
    """
    if bits:
        raise FieldError(f"resolution = {bits!r}; allowed on {name}, which has no encoders: 0")
    return p.copy()
