"""Forward Euler, x_{i+1} = x_i + d f(x_i, u_i) with the control held: the transcription of the thesis' Paper A."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates


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
