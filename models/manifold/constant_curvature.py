"""The sphere S^n, hyperbolic space H^n and R^n: spaces of constant curvature kappa = 1, -1 and 0 (D.13)."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from mathnavi.interfaces.bounds import Condition, configuration
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold import kernels
from mathnavi.models.manifold.manifold import CutLocusError, unrounded

_ROUNDING = 1e-6  # of |<p, p> - kappa| that is rounding, a float's at the worst


@configuration
class ConstantCurvature:
    """A ``Manifold`` whose points and vectors are ambient, see ``kernels``: ``size`` is n + 1, or n where kappa = 0.

    Raises ValueError for a dimension n < 1, n < 2 of a curved space (a circle is flat), or another curvature.
    """

    dimension: int  # n
    kappa: Annotated[float, Condition((-1.0, 0.0, 1.0).__contains__, "-1, 0 or 1")]  # 1, -1 or 0

    def __post_init__(self) -> None:
        least = 2 if self.kappa else 1
        if self.dimension < least:
            raise FieldError(f"dimension = {self.dimension!r}; allowed with kappa = {self.kappa:g}: at least {least}")

    @property
    def name(self) -> str:
        """Name of the space: "S^n", "H^n" or "R^n"."""
        letter = {1.0: "S", -1.0: "H", 0.0: "R"}[self.kappa]
        return f"{letter}^{self.dimension}"

    @property
    def size(self) -> int:
        """Components of an ambient point: n + 1, or n where kappa = 0."""
        return self.dimension + (self.kappa != 0.0)

    @property
    def vector_size(self) -> int:
        """Components of a tangent vector, which is ambient: ``size``."""
        return self.size

    @property
    def injectivity_radius(self) -> float:
        """Injectivity radius: pi on the sphere, infinite elsewhere."""
        return math.pi if self.kappa > 0.0 else math.inf

    @property
    def origin(self) -> Array:
        """The point (1, 0, ..., 0) (size,); zero in R^n."""
        point = np.zeros(self.size)
        if self.kappa:
            point[0] = 1.0
        return point

    def check(self, p: Array) -> Array:
        """Project p (size,) back onto the space from where rounding has put it.

        Raises ArgumentError for another shape, for numbers that are not finite, and for a point off the space.
        """
        point = np.asarray(p, dtype=np.float64)
        if point.shape != (self.size,) or not np.isfinite(point).all():
            raise ArgumentError(f"point = {np.asarray(p).tolist()}; allowed on {self.name}: {self.size} finite numbers")
        square = kernels.inner(self.kappa, point, point)
        scale = max(1.0, kernels.inner(1.0, point, point))
        near = abs(square - self.kappa) <= _ROUNDING * scale < math.inf
        if self.kappa and (not near or (self.kappa < 0.0 and point[0] <= 0.0)):
            sheet = ", p_0 > 0" if self.kappa < 0.0 else ""
            raise ArgumentError(
                f"point = {point.tolist()} is off {self.name}: <p, p> = {square:.9g}; allowed: {self.kappa:g}{sheet}"
            )
        return self.project(point)

    def project(self, p: Array) -> Array:
        """Project p (size,), nearly a point of the space, onto it; see ``kernels.project``."""
        back: Array = kernels.project(self.kappa, p)
        return back

    def tangent(self, p: Array, w: Array) -> Array:
        """Tangential part (size,) at p (size,) of an ambient vector w (size,)."""
        part: Array = kernels.tangent(self.kappa, p, w)
        return part

    def exp(self, p: Array, w: Array) -> Array:
        """exp_p w (size,) of a tangent vector w (size,) at p (size,)."""
        q: Array = kernels.exponential(self.kappa, p, w)
        return q

    def log(self, p: Array, q: Array) -> Array:
        """log_p q (size,) of points p, q (size,).

        Raises CutLocusError for opposite points of the sphere.
        """
        return self._unique(kernels.logarithm(self.kappa, p, q), p, q)

    def distance(self, p: Array, q: Array) -> float:
        """Geodesic distance of p, q (size,)."""
        return float(kernels.distance(self.kappa, p, q))

    def inner(self, p: Array, u: Array, w: Array) -> float:
        """Inner product <u, w>_g of tangent vectors u, w (size,) at p (size,)."""
        return float(kernels.inner(self.kappa, u, w))

    def norm(self, p: Array, w: Array) -> float:
        """Length |w|_g of a tangent vector w (size,) at p (size,)."""
        return float(kernels.norm(self.kappa, w))

    def transport(self, p: Array, q: Array, w: Array) -> Array:
        """Parallel transport (size,) of w (size,) from p to q (size,).

        Raises CutLocusError for opposite points of the sphere.
        """
        return self._unique(kernels.transport(self.kappa, p, q, w), p, q)

    def curvature(self, p: Array, eta: Array, G: Array) -> Array:
        """R(eta, G) eta (size,) of tangent vectors eta, G (size,) at p (size,)."""
        R: Array = kernels.curvature(self.kappa, eta, G)
        return R

    def coordinates(self, p: Array, q: Array) -> Array:
        """Normal coordinates (n,) of q (size,) about p (size,): log_p q in the ``frame`` at p."""
        return self.components(p, self.log(p, q))

    def point(self, p: Array, c: Array) -> Array:
        """Point (size,) with the normal coordinates c (n,) about p (size,)."""
        return self.exp(p, self.vector(p, c))

    def components(self, p: Array, w: Array) -> Array:
        """Components (n,) of a tangent vector w (size,) in the ``frame`` at p (size,)."""
        frame = self.frame(p)
        lowered = w * np.concatenate([[-1.0], np.ones(self.size - 1)]) if self.kappa < 0.0 else w
        found: Array = lowered @ frame
        return found

    def vector(self, p: Array, c: Array) -> Array:
        """Tangent vector (size,) with the components c (n,) in the ``frame`` at p (size,)."""
        w: Array = self.frame(p) @ c
        return w

    def rounded(self, p: Array, bits: int) -> Array:
        """Return p (size,) unchanged: there are no encoders.

        Raises FieldError unless ``bits`` is 0.
        """
        return unrounded(self.name, p, bits)

    def draw(self, rng: np.random.Generator, radius: float = 1.0) -> Array:
        """Draw a point (size,): uniform on the sphere; elsewhere in a ball of ``radius`` about the origin."""
        if self.kappa > 0.0:
            return self.check(_unit(rng.standard_normal(self.size)))
        length = radius * rng.uniform() ** (1.0 / self.dimension)
        direction: Array = length * _unit(rng.standard_normal(self.dimension))
        if self.kappa == 0.0:
            return direction
        return self.exp(self.origin, np.concatenate([[0.0], direction]))

    def draw_vector(self, rng: np.random.Generator, p: Array) -> Array:
        """Draw a tangent vector (size,) of length 1 at p (size,), uniform over all directions."""
        return self.vector(p, _unit(rng.standard_normal(self.dimension)))

    def frame(self, p: Array) -> Array:
        """Orthonormal frame (size, n) at p (size,): the axes, transported there from the origin."""
        if self.kappa == 0.0:
            return np.eye(self.size)
        origin = self.origin if p[0] >= 0.0 else -self.origin
        axes = [self.transport(origin, p, axis) for axis in np.eye(self.size)[1:]]
        return np.stack(axes, axis=1)

    def _unique(self, found: Array, p: Array, q: Array) -> Array:
        if np.isnan(found).any():
            raise CutLocusError(
                f"{np.asarray(p).tolist()} and {np.asarray(q).tolist()} are opposite points of {self.name}; allowed: "
                "points that one shortest geodesic joins"
            )
        return found


def sphere(n: int) -> ConstantCurvature:
    """Sphere S^n, the unit vectors of R^(n+1)."""
    return ConstantCurvature(n, 1.0)


def hyperbolic_space(n: int) -> ConstantCurvature:
    """Hyperbolic space H^n, the sheet p_0 > 0 of -p_0^2 + p_1^2 + ... + p_n^2 = -1."""
    return ConstantCurvature(n, -1.0)


def flat_space(n: int) -> ConstantCurvature:
    """Flat space R^n."""
    return ConstantCurvature(n, 0.0)


def _unit(w: Array) -> Array:
    return w / float(np.linalg.norm(w))
