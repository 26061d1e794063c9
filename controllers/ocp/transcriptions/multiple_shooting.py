"""Multiple shooting: x_{i+1} is the classical Runge-Kutta method's result from x_i, the control held.

The only scheme here whose plan is exact under a zero-order hold, and explicit, as FATROP needs it. Path
constraints hold at the nodes and between the steps.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.runge_kutta import classical_sum, halfway


@configuration
class MultipleShooting:
    """Multiple shooting by ``steps`` Runge-Kutta steps of fourth order over each interval; FieldError for steps < 1."""

    steps: Count = 2
    name: str = "multiple shooting"
    order: int = 4
    points: tuple[float, ...] = (0.0,)
    shared: bool = False
    interior: int = 0
    explicit: bool = True
    costate_at: float = 1.0

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """x_1 and the cost after ``steps`` Runge-Kutta steps of width d / steps, u held."""
        h, x, cost = d / self.steps, x_0, ca.SX(0)
        between: list[tuple[float, ca.SX]] = []
        for k in range(self.steps):
            now = t + k * h
            if k > 0:
                between.append((k / self.steps, x))
            f_1, l_1 = rates(x, U[0], now)
            f_2, l_2 = rates(halfway(x, h, f_1), U[0], now + h / 2)
            f_3, l_3 = rates(halfway(x, h, f_2), U[0], now + h / 2)
            f_4, l_4 = rates(x + h * f_3, U[0], now + h)
            x, cost = classical_sum(x, h, f_1, f_2, f_3, f_4), classical_sum(cost, h, l_1, l_2, l_3, l_4)
        return IntervalEquations(x, ca.SX(0, 1), cost, (x_0,), tuple(between))
