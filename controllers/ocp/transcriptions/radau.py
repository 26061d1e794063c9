"""Radau IIA collocation: stiffly accurate, with a point at the end of an interval and none at its start.

In each interval the dynamics hold at the k zeros 0 < c_1 < ... < c_k = 1 of P_k - P_{k-1} (Legendre's polynomials on
[0, 1]), in integral form (see ``collocation``). Controls of neighbouring intervals have no point in common, so
a control may jump at a node; at the start of an interval it is the polynomial's extrapolation. The method damps what is
stiff and does not let a singular control ring between two levels, as Lobatto's symmetric points do.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Annotated

import casadi as ca
import numpy as np
from annotated_types import Ge, Le
from numpy.polynomial import Legendre

from mathnavi.controllers.ocp.transcriptions.collocation import collocated
from mathnavi.controllers.ocp.transcriptions.scheme import IntervalEquations, Rates
from mathnavi.interfaces.bounds import configuration


@configuration
class RadauIIA:
    """Radau IIA collocation at ``count`` points k of every interval; order 2 k - 1.

    FieldError for a number of points outside 2 to 30.
    """

    count: Annotated[int, Ge(2), Le(30)] = 3
    shared: bool = False
    explicit: bool = False
    costate_at: float = 0.0

    @property
    def name(self) -> str:
        """Name of the scheme, with its order."""
        return f"Radau IIA of order {self.order}"

    @property
    def order(self) -> int:
        """Order 2 k - 1 of a state at the end of an interval."""
        return 2 * self.count - 1

    @property
    def interior(self) -> int:
        """Number k - 1 of unknown states inside an interval."""
        return self.count - 1

    @cached_property
    def points(self) -> tuple[float, ...]:
        """Radau points (k,) c_j, fractions of the interval."""
        return radau(self.count)

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """X_j = x_0 + d Σ_k A_jk f_k at the inner points and at the end, at the cost d Σ_k b_k L_k."""
        return collocated(self.points, rates, x_0, X, x_1, U, t, d)


@lru_cache(maxsize=64)
def radau(count: int) -> tuple[float, ...]:
    """Radau points (k,): the zeros of P_k - P_{k-1} on [0, 1], the last of them 1, k = ``count``."""
    zeros = np.sort(np.real((Legendre.basis(count) - Legendre.basis(count - 1)).roots()))
    return (*(0.5 * (1.0 + zeros[:-1])).tolist(), 1.0)
