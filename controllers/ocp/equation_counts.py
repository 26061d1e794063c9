"""Equations of a statement against the freedom to meet them: more than that are refused before anything is solved.

Equations are counted by the rank of their slopes near the guess, each over the scales of the variables: so the unit of
a statement does not matter. Equations of constants that follow from others, as where phases share one and it is stated
twice, are left out: a solver would count them.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.expressions import column
from mathnavi.controllers.ocp.problem_functions import MOST_ROWS
from mathnavi.controllers.ocp.statement import Statement
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_POINTS = 3  # in general position, of which the largest rank counts
_AWAY = 0.1  # of the scale, that such a point is away from the guess


def check_equations(statement: Statement, guess: Array, scale: Array, nominal: Array) -> None:
    """Refuse more equations than there is freedom to meet them.

    Args:
        statement: all that is stated; its duration is.
        guess: (k, nx) states from the start to the end.
        scale: (nx,) of the states.
        nominal: (np,) parameters.

    Raises:
        ProblemError: with the equations that are too many, and what they could determine.
    """
    assert statement.duration is not None
    name, free, duration = statement.name, int(statement.duration.free), statement.duration.guess
    every = [[row for row in rows if row.lower == row.upper] for rows in (statement.initial, statement.final)]
    unknown = ca.vertcat(statement.x, statement.final_time)
    slopes = [
        _Slopes(statement, rows, np.append(x, duration), np.append(scale, duration), nominal)
        for rows, x in zip(every, (guess[0], guess[-1]), strict=True)
    ]
    sizes = statement.x.numel(), statement.x.numel() + free
    for where, rows, own, size in zip(("the start", "the end"), every, slopes, sizes, strict=True):
        most = own.rank(size)
        if len(rows) > most:
            raise ProblemError(
                f"{name}: {len(rows)} equations at {where}: {_listed([row.name for row in rows])}; "
                f"allowed: {most}, as many as {_names(unknown[:size])} can meet"
            )
    along = [row for row in statement.path if row.lower == row.upper]
    if len(along) > statement.u.numel():
        raise ProblemError(
            f"{name}: {len(along)} equations at the path: {_listed([row.name for row in along])}; "
            f"allowed: {statement.u.numel()}, as many as {_names(statement.u)} can meet"
        )
    pinned, most = sum(len(rows) for rows in every), len(statement.states) + free
    if not statement.controls and pinned > most and (pinned := _at_both_ends(statement, slopes, free)) > most:
        raise ProblemError(
            f"{name}: {pinned} equations at the start and the end, and no control; "
            f"allowed: {most}, as many as there are states" + " and the final time" * free
        )


class _Slopes:
    """Slopes of equations by the states and the final time, over their scales, each of length one."""

    def __init__(self, statement: Statement, rows: list[Row], at: Array, scale: Array, nominal: Array) -> None:
        unknown = ca.vertcat(statement.x, statement.final_time)
        slopes = ca.jacobian(column(row.expression for row in rows), unknown)
        self._structural = slopes
        function = ca.Function("slopes", [unknown, statement.p], [ca.densify(slopes)])
        self.values: list[Array] = []  # (m, nx + 1) at each point where they are finite
        for point in range(_POINTS):
            near = at + _AWAY * scale * np.cos(1.0 + point + np.arange(len(at)))
            found = np.array(function(near, nominal)).reshape(len(rows), len(at)) * scale
            if np.isfinite(found).all():
                length = np.linalg.norm(found, axis=1, keepdims=True)
                self.values.append(found / np.where(length > 0.0, length, 1.0))

    def rank(self, size: int) -> int:
        """Number of equations that the first ``size`` unknowns can meet at once; structural where nothing is finite."""
        if not self.values:
            return int(ca.sprank(self._structural[:, :size]))
        return max(_rank(values[:, :size]) for values in self.values)


def without_repetitions(statement: Statement) -> tuple[list[Row], list[Row]]:
    """Rows of the start and of the end, without equations of constants alone that follow from those before them.

    Only linear ones are compared.
    """
    constants = column(v.symbol for v in statement.states if statement.rates[v.name].is_zero())
    known, kept = np.empty((0, constants.numel() + 1)), list[bool]()
    for row in (*statement.initial, *statement.final):
        made = _linear(row, constants)
        follows = made is not None and len(known) > 0 and _rank(np.vstack([known, made])) == _rank(known)
        if made is not None and not follows:
            known = np.vstack([known, made])
        kept.append(not follows)
    return (
        [row for row, is_kept in zip(statement.initial, kept, strict=False) if is_kept],
        [row for row, is_kept in zip(statement.final, kept[len(statement.initial) :], strict=True) if is_kept],
    )


def _linear(row: Row, constants: ca.SX) -> Array | None:
    """Slopes and constant part (n + 1,) of an equation that is linear in constants (n,) and has no other symbols."""
    if row.lower != row.upper or any(not ca.depends_on(constants, each) for each in ca.symvar(row.expression)):
        return None
    slopes = ca.jacobian(row.expression, constants)
    if not slopes.is_constant():
        return None
    rest = ca.Function("rest", [constants], [row.expression])(np.zeros(constants.numel()))
    made = np.append(np.array(ca.DM(slopes).full())[0], float(rest) - row.lower)
    length = float(np.linalg.norm(made))
    return made / length if length > 0.0 else None


def _rank(matrix: Array) -> int:
    return int(np.linalg.matrix_rank(matrix)) if matrix.size else 0


def _at_both_ends(statement: Statement, slopes: list[_Slopes], free: int) -> int:
    """Number of independent equations at both ends, where a state that is constant is the same unknown."""
    nx, (start, end) = len(statement.states), slopes
    constant = np.array([statement.rates[v.name].is_zero() for v in statement.states], dtype=bool)
    ranks = []
    for first, last in zip(start.values, end.values, strict=False):
        beginning = np.hstack([first[:, :nx], np.zeros((len(first), nx + free))])
        ending = np.hstack([np.where(constant, last[:, :nx], 0.0), np.where(constant, 0.0, last[:, :nx])])
        ranks.append(_rank(np.vstack([beginning, np.hstack([ending, last[:, nx : nx + free]])])))
    return max(ranks, default=sum(ca.sprank(own._structural) for own in slopes))


def _names(unknown: ca.SX) -> str:
    return _listed([symbol.name() for symbol in ca.symvar(unknown)]) or "no control"


def _listed(names: list[str]) -> str:
    """The names, or as many of them as a line has room for, and how many more."""
    more = len(names) - MOST_ROWS
    return ", ".join(names if more <= 0 else [*names[:MOST_ROWS], f"{more} more"])
