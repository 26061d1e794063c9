"""Bounds of controls that a path constraint implies: |u_j| <= 1 next to u'u <= 1, for one.

They add nothing, but where one of them holds its slope is that of the constraint: multipliers are not unique there, and
a barrier keeps the solution away from a limit that never acts. So a programme is better off without them.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.interfaces.signals import Array

_ROUNDING = 1e-9  # relative


def without_implied(limits: Interval, path: list[Row], u: ca.SX) -> Interval:
    """The bounds (nu,) of the controls u (nu,), infinite where a weighted sum of their squares on the path limits both.

    A constraint c + Σ h_j u_j^2 / 2 <= d with h >= 0 implies |u_j| <= sqrt(2 (d - c) / h_j).
    """
    lower, upper = limits.lower.copy(), limits.upper.copy()
    for row in path:
        for sign, limit in ((1.0, row.upper), (-1.0, -row.lower)):
            most = _most(sign * row.expression, limit, u)
            implied = (-lower >= most * (1.0 - _ROUNDING)) & (upper >= most * (1.0 - _ROUNDING))
            lower[implied], upper[implied] = -math.inf, math.inf
    return Interval(lower, upper)


def _most(made: ca.SX, limit: float, u: ca.SX) -> Array:
    """Largest |u_j| (nu,) where a sum of squares is at most a limit; infinite for other expressions."""
    unlimited = np.full(u.numel(), math.inf)
    if not math.isfinite(limit) or not u.numel() or any(not ca.depends_on(u, each) for each in ca.symvar(made)):
        return unlimited
    curvature, slope = ca.hessian(made, u)
    if not curvature.is_constant():
        return unlimited
    weights, rest = np.array(ca.DM(curvature).full()), ca.Function("c", [u], [made, slope])(np.zeros(u.numel()))
    spare = limit - float(rest[0])
    h = np.diag(weights)
    if np.any(np.array(rest[1])) or np.any(weights != np.diag(h)) or (h < 0.0).any() or not spare > 0.0:
        return unlimited
    return np.where(h > 0.0, np.sqrt(2.0 * spare / np.where(h > 0.0, h, 1.0)), math.inf)
