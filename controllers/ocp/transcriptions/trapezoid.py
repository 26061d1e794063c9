"""Trapezoidal collocation, x_{i+1} = x_i + d (f_i + f_{i+1}) / 2, the control linear in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates


@dataclass(frozen=True)
class Trapezoid:
    """Trapezoidal collocation: second order, Lobatto IIIA with two points."""

    name: str = "trapezoid"
    order: int = 2
    points: tuple[float, ...] = (0.0, 1.0)
    shared: bool = True
    interior: int = 0
    explicit: bool = False
    costate_at: float = 0.5

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """x_1 = x_0 + d (f_0 + f_1) / 2, at the cost d (L_0 + L_1) / 2."""
        (f_0, cost_0), (f_1, cost_1) = rates(x_0, U[0], t), rates(x_1, U[1], t + d)
        return IntervalEquations(x_0 + d * (f_0 + f_1) / 2, ca.SX(0, 1), d * (cost_0 + cost_1) / 2, (x_0, x_1))
