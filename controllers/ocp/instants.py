"""Costs and constraints at given times inside a problem: readings that are fitted, points that are passed on time.

    J = ∫ L dt + Psi(x(T), T; p) + Σ_k Psi_k(x(t_k); p),        c_lower <= c_k(x(t_k); p) <= c_upper.

Each t_k is a node, so the terms are exact in the programme; the costate jumps there by the gradient of Psi_k.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import end_limits, rows
from mathnavi.controllers.ocp.expressions import check_symbols, column, expression, number
from mathnavi.controllers.ocp.problem_functions import InstantFunctions
from mathnavi.controllers.ocp.statement import Duration, Instant, Statement, limits
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_ROUNDING = 1e-12  # relative, by which a time may be outside [0, T]


class ProblemAt:
    """A time [s] since the start of a problem, at which a cost and constraints are stated."""

    def __init__(self, statement: Statement, time: float) -> None:
        """Take a time; ProblemError unless it is a finite number >= 0."""
        self._statement, self._time = statement, number(f"{statement.name}: at()", time)
        if not 0.0 <= self._time < np.inf:
            raise ProblemError(f"{statement.name}: at({time!r}); allowed: a time >= 0 s since the start")
        self._where = f"{statement.name}: at {self._time:g} s"

    def minimise(self, cost: Any) -> None:
        """Add a cost to J, a scalar of the states at this time and of parameters; may be called again and again."""
        made = expression(f"{self._where}: cost", cost)
        if made.numel() != 1:
            raise ProblemError(f"{self._where}: cost of shape {made.shape}; allowed: one")
        self._check(f"{self._where}: cost", made)
        self._statement.instants.append(Instant(self._time, made, ()))

    def constrain(self, constraint: Any, *, lower: Any = None, upper: Any = None, name: str = "") -> None:
        """Constrain the states at this time: a comparison, or an expression with limits, without any = 0.

        ProblemError for what cannot be a constraint, and for a control, which may jump at a node.
        """
        s = self._statement
        limited = constraint, *end_limits(constraint, lower, upper)
        made = rows(f"{self._where}: constraint", *limited, name, known=[*self._known, s.u])
        for row in made:
            self._check(f"{self._where}: constraint {row.name}", row.expression)
        self._statement.instants.append(Instant(self._time, ca.SX(0), tuple(made)))

    @property
    def _known(self) -> list[ca.SX]:
        s = self._statement
        return [s.x, s.t, s.elapsed, s.p, *s.constants]

    def _check(self, where: str, made: ca.SX) -> None:
        if self._statement.controls and ca.depends_on(made, self._statement.u):
            used = [v.name for v in self._statement.controls if ca.depends_on(made, v.symbol)]
            raise ProblemError(
                f"{where} depends on {', '.join(used)}: a control may jump at a node; allowed: states, parameters and "
                "time, such as a state whose rate is a control"
            )
        check_symbols(where, made, ca.vertcat(*self._known))


def instant_functions(statement: Statement) -> InstantFunctions | None:
    """Compile what is stated at given times, of a statement without t and T; None where nothing is.

    ProblemError for a time outside [0, T], and for one inside of a duration that is free.
    """
    if not statement.instants:
        return None
    assert statement.duration is not None
    T = statement.duration.guess
    for each in statement.instants:
        check_instant(statement.name, each.time, statement.duration)
    times = sorted({each.time for each in statement.instants})
    states = [ca.SX.sym(f"x({time:g})", len(statement.states)) for time in times]
    cost, values = ca.SX(0), list[ca.SX]()
    for each in statement.instants:
        there = states[times.index(each.time)]
        cost += ca.substitute(each.cost, statement.x, there)
        values += [ca.substitute(row.expression, statement.x, there) for row in each.rows]
    known = [ca.vertcat(*states), statement.p]
    stated = [(each.time, row) for each in statement.instants for row in each.rows]
    return InstantFunctions(
        fractions=np.minimum(np.array(times) / T, 1.0),
        cost=ca.Function("Psi_k", known, [cost]),
        rows=ca.Function("c_k", known, [column(values)]),
        bounds=limits([row for _, row in stated]),
        names=tuple(f"{row.name} at {time:g} s" for time, row in stated),
    )


def check_instant(name: str, time: float, duration: Duration) -> None:
    """Raise ProblemError for a time [s] outside [0, T], and for one inside of a duration that is free."""
    if duration.free and time > 0.0:
        raise ProblemError(
            f"{name}: at({time:g}): the duration is free; allowed: a duration that is fixed, or two phases, the first "
            "of them ending there"
        )
    if not time <= duration.guess * (1.0 + _ROUNDING):
        raise ProblemError(f"{name}: at({time:g}); allowed: 0 to {duration.guess:g} s, the duration")


def instant_cost(found: InstantFunctions, x: Array, p: Array) -> float:
    """Σ_k Psi_k of states (m, nx) at the times."""
    return float(found.cost(x.ravel(), p))


def instant_excess(found: InstantFunctions, x: Array, p: Array) -> float:
    """Largest violation of the constraints by states (m, nx) at the times, over max(1, |limit|); 0 without any."""
    if not found.names:
        return 0.0
    values, (lower, upper) = found.rows(x.ravel(), p).full()[:, 0], found.bounds
    size = np.maximum(1.0, np.maximum(*(np.where(np.isfinite(side), np.abs(side), 0.0) for side in (lower, upper))))
    over = np.maximum(np.maximum(lower - values, values - upper), 0.0) / size
    return float(np.nan_to_num(over, nan=np.inf).max())
