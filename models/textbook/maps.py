"""CasADi expressions as functions of numbers, and their inverses."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import NumericFunction

_STEPS = 50  # of Newton's method at most
_EXACT = 1e-13  # relative residual at which it stops
_LEAST = 1e-3  # share of a step below which it gives up


def of_numbers(expression: Callable[[casadi.SX], casadi.SX], n: int) -> Callable[[Array], Array]:
    """Turn an expression of (n,) into a function of numbers (n,) with a flat value."""
    x = casadi.SX.sym("x", n)
    function = NumericFunction(casadi.Function("f", [x], [expression(x)]))
    return lambda at: function(at)[0].ravel()


def inverse(T: Callable[[casadi.SX], casadi.SX], n: int) -> Callable[[Array, Array], Array | None]:
    """Invert T by Newton's method: (z (n,), near (n,)) -> the x (n,) with T(x) = z found from ``near``, or None.

    A step that does not bring T(x) nearer to z is halved until it does.
    """
    x = casadi.SX.sym("x", n)
    value_and_slope = NumericFunction(casadi.Function("T", [x], [T(x), casadi.jacobian(T(x), x)]))

    def found(z: Array, near: Array) -> Array | None:
        at, share = np.array(near, dtype=np.float64), 1.0
        residual, slope = _residual(value_and_slope, at, z)
        for _ in range(_STEPS):
            size = float(np.abs(residual).max())
            if size <= _EXACT * (1.0 + float(np.abs(z).max())):
                return at
            try:
                step = np.linalg.solve(slope, residual)
            except np.linalg.LinAlgError:
                return None
            share = min(1.0, 2.0 * share)
            while share >= _LEAST:
                after, after_slope = _residual(value_and_slope, at + share * step, z)
                if float(np.abs(after).max()) < size:  # not where it is NaN
                    break
                share *= 0.5
            else:
                return None
            at, residual, slope = at + share * step, after, after_slope
        return None

    return found


def _residual(function: NumericFunction, at: Array, z: Array) -> tuple[Array, Array]:
    value, slope = function(at)
    return z - value.ravel(), slope
