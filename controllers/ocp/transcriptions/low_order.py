"""Transcriptions of low order, without states inside an interval as unknowns.

**Forward Euler**: x_{i+1} = x_i + d f(x_i, u_i), the control held: the transcription of the thesis' Paper A.

**Trapezoid**: x_{i+1} = x_i + d (f_i + f_{i+1}) / 2, the control linear in between.

**Hermite-Simpson**: the state is a cubic and the control a parabola over each interval.

    x_c = (x_i + x_{i+1}) / 2 + d (f_i - f_{i+1}) / 8,        x_i + d (f_i + 4 f_c + f_{i+1}) / 6 - x_{i+1} = 0.

The midpoint's state is not an unknown but the expression above (compressed form); its control is one.

**Multiple shooting**: x_{i+1} is the classical Runge-Kutta method's result from x_i, the control held. It is the only
scheme here whose plan is exact under a zero-order hold, and explicit, as FATROP needs it. Path constraints hold at the
nodes and between the steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.runge_kutta import classical_sum, halfway


@dataclass(frozen=True)
class Euler:
    """Forward Euler: first order, the control held over the interval."""

    name: str = "forward Euler"
    order: int = 1
    points: tuple[float, ...] = (0.0,)
    shared: bool = False
    interior: int = 0
    explicit: bool = True
    costate_at: float = 1.0

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """x_1 = x_0 + d f(x_0, u, t), at the cost d L(x_0, u, t)."""
        f, cost = rates(x_0, U[0], t)
        return IntervalEquations(x_0 + d * f, ca.SX(0, 1), d * cost, (x_0,))


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
