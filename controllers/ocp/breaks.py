"""Break times: where a statement jumps or has a kink at a time that is known, so that a node can be placed there.

They are the knots of tables of the time (``casadi.interpolant(..., "linear", ...)``), and the times at which a
comparison, an absolute value, or a least or largest value of expressions of the time alone changes sides, as in
``casadi.if_else(t < 6, ...)``. A transcription loses its order in an interval that contains one of them.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from mathnavi.controllers.ocp.expressions import number
from mathnavi.controllers.ocp.linear_tables import MOST_KNOTS, table_knots
from mathnavi.controllers.ocp.statement import Statement
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_SWITCHES = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX)  # of two expressions
_KINKS = (ca.OP_FABS, ca.OP_SIGN)  # where an expression is zero
_SAMPLES = 2001  # of an expression of the time that is not linear in it
_SAME = 1e-9  # of T: times that are as near are one


def break_fractions(statement: Statement) -> tuple[float, ...]:
    """Fractions of T, in ]0, 1[, of the break times of a statement whose time is counted from its start.

    They are those of what is stated at given times, and those that are found; none where T is free: there they are
    surfaces that a trajectory crosses (see ``crossings``).
    """
    assert statement.duration is not None
    if statement.duration.free:
        return ()
    T = statement.duration.guess
    found = np.array(_found(statement, T))
    return fractions(np.concatenate([[each.time for each in statement.instants], found]) / T)


def fractions(values: Array) -> tuple[float, ...]:
    """Fractions of T in increasing order, those in ]0, 1[ that differ."""
    inside = np.sort(values[(values > _SAME) & (values < 1.0 - _SAME)])
    return tuple(inside[np.append(True, np.diff(inside) > _SAME)].tolist()) if len(inside) else ()


def times_of(name: str, breaks: Any, T: float) -> list[float]:
    """Break times [s] that a person gives; ProblemError, with the problem's ``name``, unless each is inside ]0, T[."""
    wrong = ProblemError(f"{name}: breaks = {breaks!r:.80}; allowed: times between 0 and {T:g} s")
    if isinstance(breaks, (str, bytes)) or np.ndim(breaks) != 1:
        raise wrong
    times = [number(f"{name}: breaks", each) for each in breaks]
    if not all(0.0 < each < T for each in times):
        raise wrong
    return times


def _found(statement: Statement, T: float) -> list[float]:
    """Times [s] in [0, T] at which an expression of the statement jumps or has a kink."""
    along = [*statement.rates.values(), statement.running, *(row.expression for row in statement.path)]
    function = ca.Function("along", statement.along, [ca.vertcat(*along)])
    codes = [function.instruction_id(k) for k in range(function.n_instructions())]
    if not {ca.OP_CALL, *_SWITCHES, *_KINKS} & set(codes):
        return []
    steps = ca.vertsplit(function.instructions_sx())
    times = list[float]()
    for code, made in zip(codes, steps, strict=True):
        if code == ca.OP_CALL:
            sides = _table_sides(made)
        elif code in _SWITCHES:
            sides = [made.dep(0) - made.dep(1)]
        else:
            sides = [made.dep(0)] if code in _KINKS else []
        for side in sides:
            times += _zeros(side, statement.t, T)
    return times if len(fractions(np.array(times) / T)) <= MOST_KNOTS else []


def _table_sides(call: ca.SX) -> list[ca.SX]:
    """Expressions that are zero at the knots of a linear table that is called."""
    table = call.which_function()
    if table.class_name() != "LinearInterpolant":
        return []
    return [call.dep(k) - knot for k, own in enumerate(table_knots(table)) for knot in own.tolist()]


def _zeros(side: ca.SX, t: ca.SX, T: float) -> list[float]:
    """Times in [0, T] at which an expression of the time alone is zero; none of another expression."""
    symbols = ca.symvar(side)
    if len(symbols) != 1 or not ca.is_equal(symbols[0], t):
        return []
    slope = ca.jacobian(side, t)
    if slope.is_constant():
        return [-float(ca.substitute(side, t, 0.0)) / float(slope)] if float(slope) else []
    value = ca.Function("side", [t], [side])
    times = np.linspace(0.0, T, _SAMPLES)
    sampled = np.array(value(times[None, :]).full())[0]
    crossed = np.flatnonzero(np.sign(sampled[:-1]) * np.sign(sampled[1:]) < 0.0)
    return [*times[sampled == 0.0], *(brentq(lambda now: float(value(now)), times[k], times[k + 1]) for k in crossed)]
