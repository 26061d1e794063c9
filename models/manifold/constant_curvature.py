"""The sphere S^n, hyperbolic space H^n and R^n: spaces of constant curvature kappa = 1, -1 and 0 (D.13).

Two-point tensors of D.4.2, in closed form on spaces of constant curvature, as maps of tangent vectors.

x is where the system is and xi where the observer is; with theta = dist(x, xi), S = theta^2 / 2,

    S^alpha = grad_xi S = -log_xi x,        S^i = grad_x S = -log_x xi,        K = PT_{xi -> x},

    S^alpha_|beta = Y_1 delta + Y_2 S^alpha S_beta                                                          (D.14)
    S^i_|alpha    = (K^i_alpha - Y_4 S^i S_alpha) / Y_3                                                     (D.15)
    K^i_alpha|beta = Y (S^i g_alpha,beta + K^i_beta S_alpha)                                                (D.18)
    K^j_alpha|k K^alpha_m = Y (S^j g_km - delta^j_k S_m)                                                    (D.19)

    Y_1 = theta cot theta,  Y_2 = (1 - Y_1) / 2 S,  Y_3 = -sin theta / theta,  Y_4 = -(1 + Y_3) / 2 S,
    Y = kappa tan(theta / 2) / theta,

with coth, sinh and tanh in hyperbolic space, where 2 S = theta^2 keeps its sign. (D.15) is solved for the
mixed derivative and (D.19) has its indices so that it is true; as printed, ``printed_transport_along_x``, it is not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
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


_SMALL = 1e-3  # [rad] below which series are used, to 1e-13


@dataclass(frozen=True, eq=False)
class TwoPoint:
    """Two-point tensors at one pair of points x, xi (size,).

    Vectors are ambient, (size,), and tangent at the point that they belong to.
    """

    space: ConstantCurvature
    x: Array
    xi: Array

    @cached_property
    def theta(self) -> float:
        """Distance of x and xi."""
        return self.space.distance(self.x, self.xi)

    @cached_property
    def S(self) -> float:  # noqa: N802  the thesis' letter
        """S = theta^2 / 2."""
        return 0.5 * self.theta**2

    @cached_property
    def at_xi(self) -> Array:
        """Gradient S^alpha (size,) at xi."""
        return -self.space.log(self.xi, self.x)

    @cached_property
    def at_x(self) -> Array:
        """Gradient S^i (size,) at x."""
        return -self.space.log(self.x, self.xi)

    def to_x(self, w: Array) -> Array:
        """K^i_alpha w^alpha (size,) at x: w (size,), transported from xi."""
        return self.space.transport(self.xi, self.x, w)

    def to_xi(self, w: Array) -> Array:
        """K_i^alpha w^i (size,) at xi: the inverse of ``to_x``, which is its transpose (D.5)."""
        return self.space.transport(self.x, self.xi, w)

    def hessian(self, w: Array) -> Array:
        """S^alpha_|beta w^beta (size,) of w (size,) at xi (D.14)."""
        return self._y1 * w + self._y2 * self.space.inner(self.xi, self.at_xi, w) * self.at_xi

    def mixed(self, w: Array) -> Array:
        """S^i_|alpha w^alpha (size,) at x of w (size,) at xi (D.15)."""
        along = self.space.inner(self.xi, self.at_xi, w)
        return (self.to_x(w) - self._y4 * along * self.at_x) / self._y3

    def transport_along_xi(self, w: Array, along: Array) -> Array:
        """K^i_alpha|beta w^alpha along^beta (size,) at x, of w and ``along`` (size,) at xi (D.18)."""
        inner = self.space.inner
        carried = self.to_x(along)
        return self.upsilon * (inner(self.xi, w, along) * self.at_x + inner(self.xi, self.at_xi, w) * carried)

    def transport_along_x(self, w: Array, along: Array) -> Array:
        """K^j_alpha|k K^alpha_m w^m along^k (size,), w and ``along`` (size,) at x (D.19)."""
        inner = self.space.inner
        return self.upsilon * (inner(self.x, w, along) * self.at_x - inner(self.x, self.at_x, w) * along)

    def printed_transport_along_x(self, w: Array, along: Array) -> Array:
        """(D.19) with the indices as printed: Y (S^j g_km - delta^j_m S_k) w^m along^k (size,)."""
        inner = self.space.inner
        return self.upsilon * (inner(self.x, w, along) * self.at_x - inner(self.x, self.at_x, along) * w)

    # ---- Y_1 to Y_4 and Y

    @cached_property
    def _y1(self) -> float:
        k, theta = self.space.kappa, self.theta
        if not k or theta < _SMALL:
            return 1.0 - k * theta**2 / 3.0 - k * k * theta**4 / 45.0
        return theta / (math.tan(theta) if k > 0.0 else math.tanh(theta))

    @cached_property
    def _y2(self) -> float:
        k, theta = self.space.kappa, self.theta
        return k / 3.0 + k * k * theta**2 / 45.0 if not k or theta < _SMALL else (1.0 - self._y1) / theta**2

    @cached_property
    def _y3(self) -> float:
        k, theta = self.space.kappa, self.theta
        if not k or theta < _SMALL:
            return -1.0 + k * theta**2 / 6.0 - k * k * theta**4 / 120.0
        return -(math.sin(theta) if k > 0.0 else math.sinh(theta)) / theta

    @cached_property
    def _y4(self) -> float:
        k, theta = self.space.kappa, self.theta
        return -k / 6.0 + k * k * theta**2 / 120.0 if not k or theta < _SMALL else -(1.0 + self._y3) / theta**2

    @cached_property
    def upsilon(self) -> float:
        """Y = kappa tan(theta / 2) / theta, tanh where kappa < 0."""
        k, half = self.space.kappa, 0.5 * self.theta
        if not k or half < _SMALL:
            return 0.5 * k * (1.0 + k * half**2 / 3.0)
        return 0.5 * k * (math.tan(half) if k > 0.0 else math.tanh(half)) / half
