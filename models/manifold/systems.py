"""Point systems on the spaces of constant curvature, and the rigid body, which is one of them.

A potential or a force is written in the ambient space; only its tangential part acts. ``linear`` is U = c p_i, the
potential of a pendulum on the sphere and, with i = 0, a bowl in hyperbolic space. ``printed`` is the force of the
example in D.5, F = -grad W with W = sin x_1 cos x_2 cos x_3 on S^3, which is

    W = p_1 p_2 / sqrt(p_2^2 + p_3^2),        p = (cos x_1, sin x_1 cos x_2, sin x_1 sin x_2 cos x_3, ...)

and not smooth where sin x_2 = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import NumericFunction
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.constant_curvature import ConstantCurvature
from mathnavi.models.manifold.system import integrate
from mathnavi.models.runge_kutta import Flow

_FARTHEST = 1e6  # p_0 = cosh(dist(p, origin)), 14.5 from it

Potential = Callable[[casadi.SX], casadi.SX]
"""potential U(p) [1/s^2] of an ambient point (size,)"""


def linear(strength: float, component: int) -> Potential:
    """Potential U = c p_i, linear in the i-th coordinate of the ambient space."""
    return lambda p: strength * p[component]


def printed(p: casadi.SX) -> casadi.SX:
    """Potential W of D.5, of an ambient point p (4,)."""
    return p[1] * p[2] / casadi.sqrt(p[2] ** 2 + p[3] ** 2)


def chart(angles: Array) -> tuple[Array, Array]:
    """Point (4,) of S^3 at the angles x (3,) [rad] of D.5, and its derivative (4, 3) by them."""
    (c_1, c_2, c_3), (s_1, s_2, s_3) = np.cos(angles), np.sin(angles)
    point = np.array([c_1, s_1 * c_2, s_1 * s_2 * c_3, s_1 * s_2 * s_3])
    slope = np.array(
        [
            [-s_1, 0.0, 0.0],
            [c_1 * c_2, -s_1 * s_2, 0.0],
            [c_1 * s_2 * c_3, s_1 * c_2 * c_3, -s_1 * s_2 * s_3],
            [c_1 * s_2 * s_3, s_1 * c_2 * s_3, s_1 * s_2 * c_3],
        ]
    )
    return point, slope


@dataclass(frozen=True, eq=False)
class PointSystem:
    """D_t v = -grad U + F on a space of constant curvature: a ``LagrangianSystem``, and the law of an ODE plant.

    The state is (p, v), ambient. The input is an ambient force (size,) [1/s^2], of which the tangential part acts.
    """

    manifold: ConstantCurvature
    potential: Potential
    velocity_dependent = False

    @property
    def constant(self) -> tuple[float, ...]:
        """Default input (size,): zeros."""
        return (0.0,) * self.manifold.size

    amplitude = constant

    @property
    def states(self) -> tuple[str, ...]:
        """Names and units (2 size,) of the state (p, v)."""
        n = self.manifold.size
        return (*(f"position_{k} [-]" for k in range(n)), *(f"velocity_{k} [1/s]" for k in range(n)))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names and units (size,) of the ambient force."""
        return tuple(f"force_{k} [1/s^2]" for k in range(self.manifold.size))

    def force(self, x: Array, v: Array, u: Array) -> Array:
        """Tangential force (size,) [1/s^2] at the point x (size,) under the ambient input u (size,)."""
        f: Array = self._force_buffer(x, u)[0].ravel()
        return f

    def flow(self, state: Array, u: Array, h: float) -> Array:
        """State (2 size,) after h [s] with u (size,) held, by ``integrate``."""
        return integrate(self, state, u, h)

    def reach(self, x: Array, u: Array, dt: float) -> tuple[Array, float]:
        """Integrate x (2 size,) over dt [s] with u (size,) held.

        Returns the state, projected onto the tangent bundle, and dt, or less if the solution escapes before.
        """
        n = self.manifold.size
        after, reached = self._flow.reach(x, u, dt)
        state = self._on_bundle(after[:n], after[n:])
        # Farther out on hyperbolic space, rounding of the ambient coordinates is an error of position that counts.
        return state, reached if self.manifold.kappa >= 0.0 or state[0] <= _FARTHEST else 0.0

    def rate(self, x: Array, u: Array) -> Array:
        """Rate (p', v') (2 size,) of the state x (2 size,) under u (size,)."""
        return np.array(self._rate(x, u)).ravel()

    def output(self, x: Array, u: Array) -> Array:
        """Output y = p (size,) of the state x (2 size,)."""
        return x[: self.manifold.size].copy()

    def state(self, p: Array, v: Array) -> Array:
        """State (2 size,) of a point p (size,) and the tangential part of v (size,).

        Raises ValueError if p is off the manifold.
        """
        return self._on_bundle(self.manifold.check(p), np.asarray(v, dtype=np.float64))

    def _on_bundle(self, p: Array, v: Array) -> Array:
        p = self.manifold.project(p)
        return np.concatenate([p, self.manifold.tangent(p, v)])

    @cached_property
    def _symbols(self) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """p, u and the force."""
        n, k = self.manifold.size, self.manifold.kappa
        p, u = casadi.SX.sym("p", n), casadi.SX.sym("u", n)
        signs = casadi.DM([-1.0 if k < 0.0 else 1.0] + [1.0] * (n - 1))
        # The gradient in the ambient metric raises the index with it; the tangential part is that in X.
        F = u - signs * casadi.gradient(self.potential(p), p)
        return p, u, F - k * casadi.dot(p * signs, F) * p

    @cached_property
    def _flow(self) -> Flow:
        return Flow(self._derivative, 2 * self.manifold.size, self.manifold.size)

    def _derivative(self, x: casadi.SX, u: casadi.SX) -> casadi.SX:
        n, k = self.manifold.size, self.manifold.kappa
        p, v = x[:n], x[n:]
        at, held, F = self._symbols
        signs = casadi.DM([-1.0 if k < 0.0 else 1.0] + [1.0] * (n - 1))
        normal = k * casadi.dot(v * signs, v) * p
        return casadi.vertcat(v, casadi.substitute(F, casadi.vertcat(at, held), casadi.vertcat(p, u)) - normal)

    @cached_property
    def _rate(self) -> casadi.Function:
        x, u = casadi.SX.sym("x", 2 * self.manifold.size), casadi.SX.sym("u", self.manifold.size)
        return casadi.Function("rate", [x, u], [self._derivative(x, u)])

    @cached_property
    def _force_buffer(self) -> NumericFunction:
        p, u, F = self._symbols
        return NumericFunction(casadi.Function("force", [p, u], [F]))


@dataclass(frozen=True)
class RigidBody:
    """A body with the inertia I about every axis through the point it turns about: torque (3,) [N m], body frame."""

    inertia: float  # [kg m^2]
    constant: tuple[float, ...] = (0.0, 0.0, 0.0)
    amplitude: tuple[float, ...] = (0.0, 0.0, 0.0)
    manifold = Attitude()
    states = (
        *(f"attitude_{axis} [-]" for axis in "wxyz"),
        *(f"body_rate_{axis} [rad/s]" for axis in "xyz"),
    )
    inputs = ("torque_x [N m]", "torque_y [N m]", "torque_z [N m]")
    velocity_dependent = False

    def force(self, x: Array, v: Array, u: Array) -> Array:
        """Angular acceleration omega' = tau / I (3,) [rad/s^2] under the torque u (3,) [N m]."""
        return np.asarray(u, dtype=np.float64) / self.inertia

    def flow(self, state: Array, u: Array, h: float) -> Array:
        """State (7,), quaternion and body rate, after h [s] with the torque u (3,) [N m] held."""
        return integrate(self, state, u, h)
