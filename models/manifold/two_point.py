"""Two-point tensors of D.4.2, in closed form on spaces of constant curvature, as maps of tangent vectors.

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

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature

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
