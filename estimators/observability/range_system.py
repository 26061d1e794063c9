"""The unicycle with range sensors as a control-affine system, for observability ranks (Example C.1, thesis C.4).

    x_1' = u_1 cos phi,   x_2' = u_1 sin phi,   phi' = u_2,   y_i = e_i . (theta(s_i) - p),
    0 = e_i^perp . (theta(s_i) - p),   e_i = (cos, sin)(phi + alpha_i),

with the s_i, where the rays end, as the variables that the outputs depend on.
"""

from __future__ import annotations

import casadi

from mathnavi.estimators.observability.lie_derivatives import ControlAffineSystem
from mathnavi.estimators.observability.range_outputs import RangeOutputs
from mathnavi.interfaces.signals import Array


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
