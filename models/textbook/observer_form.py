"""Coordinates in which a system is linear up to output injection (thesis 2.4; Krener, Isidori, Respondek):

    x~ = T_1(x),   y~ = T_2(y):     x~' = A x~ - g(y, u),   y~ = C x~,   (A, C) observable.

The thesis counts the known inputs among the outputs, so that g may depend on u. With a gain L the same coordinates
serve an observer of Kazantzis and Kravaris, who require x~' = A x~ - g(y, u) with a Hurwitz A only:

    x~' = (A - L C) x~ - (g(y, u) - L T_2(y)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array


@dataclass(frozen=True, eq=False)
class ObserverForm:
    """T_1, its inverse, T_2, A, C and g of one system with a single output."""

    T_1: Callable[[casadi.SX], casadi.SX]  # (n,) -> (n,)
    T_1_inverse: Callable[[casadi.SX], casadi.SX]  # (n,) -> (n,)
    T_2: Callable[[casadi.SX], casadi.SX]  # (1,) -> (1,)
    A: Array  # (n, n)
    C: Array  # (1, n)
    g: Callable[[casadi.SX, casadi.SX], casadi.SX]  # (y (1,), u (p,)) -> (n,)

    def gain(self, poles: Sequence[float]) -> Array:
        """Gain L (n, 1) with which A - L C has these eigenvalues [1/s], by Ackermann's formula.

        Raises FieldError for poles that are not n different numbers < 0.
        """
        n = len(self.A)
        check_poles(poles, n)
        observability = np.vstack([self.C @ np.linalg.matrix_power(self.A, k) for k in range(n)])
        characteristic: Array = sum(
            c * np.linalg.matrix_power(self.A, n - k) for k, c in enumerate(np.poly(np.array(poles)))
        )
        gain: Array = characteristic @ np.linalg.solve(observability, np.eye(n)[:, -1:])
        return gain


def check_poles(poles: Sequence[float], n: int) -> None:
    """Raise FieldError unless the poles are n different real numbers < 0."""
    apart = len(set(poles)) == len(poles) == n
    if not (apart and all(np.isfinite(pole) and pole < 0.0 for pole in poles)):
        raise FieldError(f"poles = {tuple(poles)!r}; allowed: {n} different finite numbers < 0")
