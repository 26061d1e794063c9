"""Derivatives of a textbook system: of its state after a step, and of its output."""

from __future__ import annotations

from functools import lru_cache

import casadi

from mathnavi.models.buffered_function import NumericFunction
from mathnavi.models.runge_kutta import dormand_prince
from mathnavi.models.textbook.system import System


@lru_cache(maxsize=16)
def transition_slope(system: System) -> NumericFunction:
    """Function (x, u, h) -> one Jacobian (n, n), of the state after h [s], by one Dormand-Prince step."""
    x, u = casadi.SX.sym("x", len(system.states)), casadi.SX.sym("u", len(system.inputs))
    h = casadi.SX.sym("h")
    after, _ = dormand_prince(system.f, x, u, h)
    return NumericFunction(casadi.Function("transition", [x, u, h], [casadi.jacobian(after, x)]))


@lru_cache(maxsize=16)
def output_and_slope(system: System) -> NumericFunction:
    """Function (x, u) -> y (m, 1) and its Jacobian (m, n)."""
    x, u = casadi.SX.sym("x", len(system.states)), casadi.SX.sym("u", len(system.inputs))
    y = system.h(x, u)
    return NumericFunction(casadi.Function("output", [x, u], [y, casadi.jacobian(y, x)]))
