"""Observability ranks: the span of the differentials of outputs and of their Lie derivatives, differentiated by CasADi.

For a control-affine system

    x' = f(x) + sum_j g_j(x) u_j,   y = h(x, w),   0 = G(x, w),

whose outputs may depend on x through variables w that G defines (where on the wall a ray ends), the derivative of a
function F(x, w) along solutions of G = 0 is D F = F_x - F_w G_w^{-1} G_x, and L_X F = (D F) X is its Lie derivative.
The codistribution of order k is spanned by D L_{X_1} ... L_{X_j} h, j = 0, ..., k, the X_i taken from given fields:

- from f + g u with u held, for one input: d(h, y', ..., y^(k)), what an observer sees under that input;
- from f and every g_j: what some input shows. If the rank is n the system is locally weakly observable there.

The unicycle with range sensors as a control-affine system, for observability ranks (Example C.1, thesis C.4).

    x_1' = u_1 cos phi,   x_2' = u_1 sin phi,   phi' = u_2,   y_i = e_i . (theta(s_i) - p),
    0 = e_i^perp . (theta(s_i) - p),   e_i = (cos, sin)(phi + alpha_i),

with the s_i, where the rays end, as the variables that the outputs depend on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import casadi
import numpy as np

from mathnavi.estimators.observability.range_outputs import RangeOutputs
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

_RANK_TOLERANCE = 1e-9  # of the largest singular value


Map = Callable[[casadi.SX, casadi.SX], casadi.SX]
"""function of x (n,) and u (p,) that returns an expression"""


def _none() -> casadi.SX:
    return casadi.SX(0, 1)


@dataclass(frozen=True)
class ControlAffineSystem:
    """f, g, h as CasADi expressions in the symbols x and w."""

    x: casadi.SX  # (n,) symbols
    drift: casadi.SX  # (n,) f
    input_fields: casadi.SX  # (n, p) g
    output: casadi.SX  # (m,) h
    w: casadi.SX = field(default_factory=_none)  # (q,) symbols
    constraint: casadi.SX = field(default_factory=_none)  # (q,) G

    @staticmethod
    def from_functions(f: Map, h: Map, states: int, inputs: int) -> ControlAffineSystem:
        """System x' = f(x, u), y = h(x, u), where f is affine in u and h does not depend on u.

        Raises ArgumentError otherwise.
        """
        x, u = casadi.SX.sym("x", states), casadi.SX.sym("u", inputs)
        rate, output = f(x, u), h(x, u)
        g = casadi.jacobian(rate, u)
        if casadi.depends_on(g, u) or casadi.depends_on(output, u):
            raise ArgumentError("f is not affine in u, or h depends on it; allowed: f(x) + g(x) u and h(x)")
        return ControlAffineSystem(x, casadi.substitute(rate, u, 0.0), g, output)

    def held(self, u: Sequence[float]) -> casadi.SX:
        """Vector field f + g u (n,) of an input u (p,) that is held."""
        return self.drift + self.input_fields @ casadi.DM(list(u))

    @property
    def fields(self) -> tuple[casadi.SX, ...]:
        """Vector fields f, g_1, ..., g_p, each (n,)."""
        return (self.drift, *casadi.horzsplit(self.input_fields))

    def derivative(self, F: casadi.SX) -> casadi.SX:
        """Derivative D F (k, n) of F (k,), through w."""
        by_x = casadi.jacobian(F, self.x)
        if not self.w.numel():
            return by_x
        w_by_x = casadi.solve(casadi.jacobian(self.constraint, self.w), casadi.jacobian(self.constraint, self.x))
        return by_x - casadi.jacobian(F, self.w) @ w_by_x


def codistribution(system: ControlAffineSystem, fields: Sequence[casadi.SX], order: int) -> casadi.Function:
    """Codistribution: (x (n,), w (q,)) to the differentials (m (1 + r + ... + r^order), n) of h and its Lie
    derivatives.

    r is the number of ``fields``. Raises ArgumentError for a negative order, and without fields.
    """
    if order < 0 or not fields:
        raise ArgumentError(f"order = {order}, {len(fields)} fields; allowed: an order >= 0 and a field or more")
    functions, rows = [system.output], [system.derivative(system.output)]
    for _ in range(order):
        functions = [system.derivative(F) @ X for F in functions for X in fields]
        rows += [system.derivative(F) for F in functions]
    return casadi.Function("codistribution", [system.x, system.w], [casadi.vertcat(*rows)])


def singular_values(differentials: casadi.Function, x: Array, w: Array | None = None) -> Array:
    """Singular values (n,) of a codistribution at x (n,), w (q,), in descending order; not finite where it is not
    defined.
    """
    matrix = np.array(differentials(x, [] if w is None else w))
    if not np.isfinite(matrix).all():
        return np.full(matrix.shape[1], np.nan)
    values = np.zeros(matrix.shape[1])
    found = np.linalg.svd(matrix, compute_uv=False)
    values[: len(found)] = found
    return values


def rank(differentials: casadi.Function, x: Array, w: Array | None = None) -> int:
    """Rank of a codistribution at x (n,), w (q,): how many directions its functions distinguish there.

    Raises ArgumentError where it is not defined.
    """
    values = singular_values(differentials, x, w)
    if not np.isfinite(values).all():
        raise ArgumentError(
            f"x = {np.asarray(x).tolist()}: the outputs have no derivative there; allowed: where they have"
        )
    return int((values > _RANK_TOLERANCE * values[0]).sum())


def range_system(outputs: RangeOutputs) -> ControlAffineSystem:
    """Control-affine system of a unicycle: x = (x_1, x_2, phi) (3,), u = (u_1, u_2), w = (s_1, ..., s_l)."""
    x, s = casadi.SX.sym("x", 3), casadi.SX.sym("s", outputs.sensors)
    ranges, constraints = [], []
    for i, alpha in enumerate(outputs.angles):
        beta = x[2] + alpha
        seen = outputs.curve.symbolic(s[i]) - x[:2]
        ranges.append(casadi.cos(beta) * seen[0] + casadi.sin(beta) * seen[1])
        constraints.append(casadi.cos(beta) * seen[1] - casadi.sin(beta) * seen[0])
    return ControlAffineSystem(
        x,
        casadi.SX.zeros(3),
        casadi.vertcat(casadi.horzcat(casadi.cos(x[2]), 0), casadi.horzcat(casadi.sin(x[2]), 0), casadi.horzcat(0, 1)),
        casadi.vertcat(*ranges),
        s,
        casadi.vertcat(*constraints),
    )


def ray_ends(outputs: RangeOutputs, x: Array) -> Array:
    """Ray ends w (l,) of ``range_system`` at a pose x (3,): parameters s of the wall where the rays end."""
    return outputs.curve.ranges(x, outputs.alpha)[1]
