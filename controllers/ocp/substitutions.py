"""Statements with some of their symbols replaced: the time, the final time T, and constants of several phases."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.expressions import column
from mathnavi.controllers.ocp.guesses import Values
from mathnavi.controllers.ocp.statement import Instant, Statement, Variable

DURATION = "duration"
"""name of the state that stands for a free final time in dynamics and path"""


def since_start(statement: Statement) -> Statement:
    """The statement with its time counted from the start."""
    begin, t, elapsed = statement.start_time, statement.t, statement.elapsed
    if begin.is_zero() and not (statement.instants or ca.depends_on(ca.vertcat(*_expressions(statement)), elapsed)):
        return statement

    def placed(instant: Instant) -> Instant:
        now = [begin + instant.time, ca.SX(instant.time)]
        return _instant(instant, lambda made: _at(made, [t, elapsed], now))

    instants = [placed(each) for each in statement.instants]
    moved = _replaced(statement, [t, elapsed], [begin + t, t])
    return dataclasses.replace(moved, start_time=ca.SX(0), instants=instants)


def with_duration(statement: Statement) -> Statement:
    """The statement with T in dynamics, path, start and instants replaced: by its value or, where free, by a state.

    That state does not change, and ends at T. ProblemError where a variable has its name.
    """
    T, duration = statement.final_time, statement.duration
    assert duration is not None
    if not ca.depends_on(ca.vertcat(*_expressions(statement)), T):
        return statement
    if not duration.free:
        return _replaced(statement, [T], [ca.SX(duration.guess)])
    statement.check_name(DURATION)
    symbol = ca.SX.sym(DURATION)
    state = Variable(
        DURATION, symbol, duration.lower, duration.upper, duration.guess, Values(np.array([duration.guess]))
    )
    made = _replaced(statement, [T], [symbol])
    return dataclasses.replace(
        made,
        states=[*made.states, state],
        rates=made.rates | {DURATION: ca.SX(0)},
        final=[*made.final, Row(symbol - T, 0.0, 0.0, f"end of {DURATION}")],
    )


def guessed(statement: Statement) -> Statement:
    """The statement with T and the constants of all phases at their guesses, wherever a guess may depend on them."""
    assert statement.duration is not None
    constants = [v.guess.at(np.zeros(1), 1.0)[0] for v in statement.shared]
    return _replaced(statement, statement.constants, [ca.SX(float(c)) for c in (statement.duration.guess, *constants)])


def solved(statement: Statement, duration: float, constants: Sequence[float]) -> Statement:
    """The statement with the constants of all phases, and T where ``with_duration`` would replace it, at values."""
    values = [ca.SX(float(value)) for value in constants]
    made = _replaced(statement, statement.constants, [ca.SX(duration), *values])
    if not statement.shared:
        return made
    own = statement.constants[1:]
    return dataclasses.replace(
        made,
        terminal=_at(made.terminal, own, values),
        final=[_row(row, lambda each: _at(each, own, values)) for row in made.final],
    )


def _expressions(statement: Statement) -> list[ca.SX]:
    """All expressions whose symbols ``_replaced`` replaces."""
    along = [*statement.rates.values(), statement.running, *(row.expression for row in statement.path)]
    at = [part for each in statement.instants for part in (each.cost, *(row.expression for row in each.rows))]
    return [*along, *(row.expression for row in statement.initial), *at]


def _replaced(statement: Statement, symbols: Sequence[ca.SX], values: Sequence[ca.SX]) -> Statement:
    """The statement with symbols replaced in dynamics, running cost, path, start and instants."""

    def changed(made: ca.SX) -> ca.SX:
        return _at(made, symbols, values)

    return dataclasses.replace(
        statement,
        rates={name: changed(rate) for name, rate in statement.rates.items()},
        running=changed(statement.running),
        path=[_row(row, changed) for row in statement.path],
        initial=[_row(row, changed) for row in statement.initial],
        instants=[_instant(each, changed) for each in statement.instants],
    )


def _at(made: ca.SX, symbols: Sequence[ca.SX], values: Sequence[ca.SX]) -> ca.SX:
    return ca.substitute(made, column(symbols), column(values))


def _row(row: Row, change: Callable[[ca.SX], ca.SX]) -> Row:
    return dataclasses.replace(row, expression=change(row.expression))


def _instant(instant: Instant, change: Callable[[ca.SX], ca.SX]) -> Instant:
    rows = tuple(_row(row, change) for row in instant.rows)
    return dataclasses.replace(instant, cost=change(instant.cost), rows=rows)
