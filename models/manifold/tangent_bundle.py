"""Geometry of the tangent bundle TX in coordinates (x, v), for any metric: D.2.1 by CasADi.

A field on X is a map x -> (n,), one on TX a map (x, v) -> (2 n,).

    Y^V = Y^i d/dv^i,    Y^H = Y^i (d/dx^i - Gamma^m_li v^l d/dv^m),    Z = v^i d/dx^i - Gamma^i_jk v^j v^k d/dv^i

and the generalised Sasaki metric, with Dv^i = dv^i + Gamma^i_jk v^j dx^k,

    G = (dx, Dv)' ([a c; c b] x g) (dx, Dv).
"""

from __future__ import annotations

from collections.abc import Callable

import casadi

Field = Callable[[casadi.SX], casadi.SX]
"""field on X, x (n,) -> (n,)"""

BundleField = Callable[[casadi.SX, casadi.SX], casadi.SX]
"""field on TX, (x, v) -> (2 n,)"""


class TangentBundle:
    """TX over coordinates x (n,) with the metric g(x) (n, n)."""

    def __init__(self, n: int, metric: Field) -> None:
        self.n, self.metric = n, metric

    def christoffel(self, x: casadi.SX, u: casadi.SX, w: casadi.SX) -> casadi.SX:
        """Connection Gamma^i_jk u^j w^k (n,)."""
        at, first, second = (casadi.SX.sym(name, self.n) for name in ("x", "u", "w"))
        g = self.metric(at)
        # 2 Gamma_i = d_u g w + d_w g u - grad(u' g w), the arguments held.
        lowered = (
            casadi.jtimes(g @ second, at, first)
            + casadi.jtimes(g @ first, at, second)
            - casadi.gradient(casadi.dot(first, g @ second), at)
        )
        gamma = 0.5 * casadi.solve(g, lowered)
        return casadi.substitute(gamma, casadi.vertcat(at, first, second), casadi.vertcat(x, u, w))

    def covariant(self, Y: Field, x: casadi.SX, u: casadi.SX) -> casadi.SX:
        """Covariant derivative nabla_u Y (n,)."""
        return casadi.jtimes(Y(x), x, u) + self.christoffel(x, u, Y(x))

    def curvature(self, x: casadi.SX, X: casadi.SX, Y: casadi.SX, Z: casadi.SX) -> casadi.SX:
        """R(X, Y) Z (n,) = (nabla_X nabla_Y - nabla_Y nabla_X - nabla_[X, Y]) Z."""

        at, held = casadi.SX.sym("x", self.n), casadi.SX.sym("arguments", 3 * self.n)
        first, second, third = casadi.vertsplit(held, self.n)

        def half(X: casadi.SX, Y: casadi.SX) -> casadi.SX:
            slope = casadi.jtimes(self.christoffel(at, Y, third), at, X)
            return slope + self.christoffel(at, X, self.christoffel(at, Y, third))

        R = half(first, second) - half(second, first)
        return casadi.substitute(R, casadi.vertcat(at, held), casadi.vertcat(x, X, Y, Z))

    # ---- lifts and brackets

    def vertical(self, Y: Field) -> BundleField:
        """Vertical lift Y^V."""
        return lambda x, v: casadi.vertcat(casadi.SX(self.n, 1), Y(x))

    def horizontal(self, Y: Field) -> BundleField:
        """Horizontal lift Y^H."""
        return lambda x, v: casadi.vertcat(Y(x), -self.christoffel(x, v, Y(x)))

    def spray(self, x: casadi.SX, v: casadi.SX) -> casadi.SX:
        """Geodesic spray Z."""
        return casadi.vertcat(v, -self.christoffel(x, v, v))

    def sasaki(self, a: float, b: float, c: float) -> BundleField:
        """Generalised Sasaki metric G (2 n, 2 n) in the coordinates (x, v)."""

        def metric(x: casadi.SX, v: casadi.SX) -> casadi.SX:
            n, w = self.n, casadi.SX.sym("w", self.n)
            connection = casadi.jacobian(self.christoffel(x, v, w), w)
            frame = casadi.blockcat([[casadi.SX.eye(n), casadi.SX(n, n)], [connection, casadi.SX.eye(n)]])
            g = self.metric(x)
            return frame.T @ casadi.blockcat([[a * g, c * g], [c * g, b * g]]) @ frame

        return metric


def bracket(X: BundleField, Y: BundleField, x: casadi.SX, v: casadi.SX) -> casadi.SX:
    """Lie bracket [X, Y] (2 n,) = dY X - dX Y."""
    z = casadi.vertcat(x, v)
    return casadi.jtimes(Y(x, v), z, X(x, v)) - casadi.jtimes(X(x, v), z, Y(x, v))


def lie_derivative(X: BundleField, G: BundleField, x: casadi.SX, v: casadi.SX) -> casadi.SX:
    """Lie derivative L_X G (2 n, 2 n)."""
    z = casadi.vertcat(x, v)
    size = z.numel()
    slope = casadi.jacobian(X(x, v), z)
    along = casadi.reshape(casadi.jtimes(casadi.vec(G(x, v)), z, X(x, v)), size, size)
    return along + G(x, v) @ slope + slope.T @ G(x, v)
