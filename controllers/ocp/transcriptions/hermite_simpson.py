"""Hermite-Simpson collocation, the state a cubic and the control a parabola over each interval.

    x_c = (x_i + x_{i+1}) / 2 + d (f_i - f_{i+1}) / 8,        x_i + d (f_i + 4 f_c + f_{i+1}) / 6 - x_{i+1} = 0.

The midpoint's state is not an unknown but the expression above (compressed form); its control is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates


@dataclass(frozen=True)
class HermiteSimpson:
    """Hermite-Simpson collocation: fourth order at the nodes, Lobatto IIIA with three points."""

    name: str = "Hermite-Simpson"
    order: int = 4
    points: tuple[float, ...] = (0.0, 0.5, 1.0)
    shared: bool = True
    interior: int = 0
    explicit: bool = False
    costate_at: float = 0.5

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """x_1 = x_0 + d (f_0 + 4 f_c + f_1) / 6, at the cost d (L_0 + 4 L_c + L_1) / 6."""
        (f_0, cost_0), (f_1, cost_1) = rates(x_0, U[0], t), rates(x_1, U[2], t + d)
        x_c = (x_0 + x_1) / 2 + d * (f_0 - f_1) / 8
        f_c, cost_c = rates(x_c, U[1], t + d / 2)
        return IntervalEquations(
            flow=x_0 + d * (f_0 + 4 * f_c + f_1) / 6,
            inner=ca.SX(0, 1),
            cost=d * (cost_0 + 4 * cost_c + cost_1) / 6,
            states=(x_0, x_c, x_1),
        )
