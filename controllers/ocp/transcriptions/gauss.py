"""Gauss-Legendre collocation: the highest order for its number of points, none of them at an end of the interval.

In each interval the dynamics hold at the k zeros of Legendre's polynomial P_k on [0, 1], in integral form (see
``collocation``). At both ends the control is the polynomial's extrapolation, and path constraints do not hold there.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Annotated

import casadi as ca
from annotated_types import Ge, Le

from mathnavi.controllers.ocp.transcriptions.collocation import collocated
from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates, gauss_legendre
from mathnavi.interfaces.bounds import configuration


@configuration
class GaussLegendre:
    """Gauss-Legendre collocation at ``count`` points k of every interval; order 2 k.

    FieldError for a number of points outside 2 to 30.
    """

    count: Annotated[int, Ge(2), Le(30)] = 3
    shared: bool = False
    explicit: bool = False
    costate_at: float = 0.0

    @property
    def name(self) -> str:
        """Name of the scheme, with its order."""
        return f"Gauss-Legendre of order {self.order}"

    @property
    def order(self) -> int:
        """Order 2 k of a state at the end of an interval."""
        return 2 * self.count

    @property
    def interior(self) -> int:
        """Number k of unknown states inside an interval."""
        return self.count

    @cached_property
    def points(self) -> tuple[float, ...]:
        """Gauss points (k,) c_j, fractions of the interval."""
        return tuple((0.5 * (1.0 + gauss_legendre(self.count)[0])).tolist())

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """X_j = x_0 + d Σ_k A_jk f_k at the points, x_1 = x_0 + d Σ_k b_k f_k, at the cost d Σ_k b_k L_k."""
        return collocated(self.points, rates, x_0, X, x_1, U, t, d)
