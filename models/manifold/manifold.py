"""Configuration manifolds: what an observer that knows no coordinates needs to know of where a system may be."""

from __future__ import annotations

import math
from typing import Protocol

from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.signals import Array


class CutLocusError(ValueError):
    """Two points that no shortest geodesic joins, or more than one."""


class Manifold(Protocol):
    """A Riemannian manifold X. A point is an array (size,), a tangent vector at it an array (vector_size,)."""

    @property
    def name(self) -> str:
        """What it is called in messages."""
        ...

    @property
    def dimension(self) -> int:
        """n."""
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
        """Points nearer than that are joined by one shortest geodesic; ``math.inf`` where all are."""
        ...

    @property
    def kappa(self) -> float | None:
        """The sectional curvature, where that is the same everywhere; None where it is not."""
        ...

    @property
    def origin(self) -> Array:
        """Some point (size,) of it."""
        ...

    def check(self, p: Array) -> Array:
        """The point p in the form that the other methods take; ValueError if it is none of the manifold's."""
        ...

    def exp(self, p: Array, w: Array) -> Array:
        """Where the geodesic leads that leaves p with the velocity w, after 1 s."""
        ...

    def log(self, p: Array, q: Array) -> Array:
        """w at p with exp(p, w) = q, the shortest; CutLocusError where there is none."""
        ...

    def distance(self, p: Array, q: Array) -> float:
        """The length of that geodesic."""
        ...

    def norm(self, p: Array, w: Array) -> float:
        """|w|_g at p."""
        ...

    def transport(self, p: Array, q: Array, w: Array) -> Array:
        """w at p, moved in parallel along the shortest geodesic to q; CutLocusError where there is none."""
        ...

    def curvature(self, p: Array, eta: Array, G: Array) -> Array:
        """R(eta, G) eta at p: the term R^alpha of (D.6), by the index conventions of D.2.1."""
        ...

    def coordinates(self, p: Array, q: Array) -> Array:
        """(n,) of q in a chart about p, in the units of an encoder there; CutLocusError where there are none."""
        ...

    def point(self, p: Array, c: Array) -> Array:
        """The point with the coordinates c (n,) about p."""
        ...

    def rounded(self, p: Array, bits: int) -> Array:
        """What encoders of so many bits over a turn or a metre say of p; p itself for 0 bits."""
        ...

    def components(self, p: Array, w: Array) -> Array:
        """(n,) of a tangent vector w at p: the rates of the coordinates about p."""
        ...

    def vector(self, p: Array, c: Array) -> Array:
        """The tangent vector at p with the components c (n,)."""
        ...


def is_beyond(manifold: Manifold, p: Array, q: Array, share: float = 1.0) -> bool:
    """Whether two points are farther apart than a share of the injectivity radius."""
    return manifold.injectivity_radius < math.inf and (manifold.distance(p, q) >= share * manifold.injectivity_radius)


def unrounded(name: str, p: Array, bits: int) -> Array:
    """p, where there are no joints that an encoder could turn with; ValueError if it is to round."""
    if bits:
        raise FieldError(f"resolution = {bits!r}; allowed on {name}, which has no encoders: 0")
    return p.copy()
