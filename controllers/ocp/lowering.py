"""Lowering of a statement to the compiled functions that the transcriptions, the replay and the methods work with."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.breaks import break_fractions
from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.equation_counts import check_equations, without_repetitions
from mathnavi.controllers.ocp.expressions import check_symbols, column
from mathnavi.controllers.ocp.guesses import SAMPLES, Derived, integral, simulated
from mathnavi.controllers.ocp.implied_bounds import without_implied
from mathnavi.controllers.ocp.instants import instant_functions
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.scaling import Scale, variable_scales
from mathnavi.controllers.ocp.statement import Statement, Variable, bounds, limits
from mathnavi.controllers.ocp.substitutions import since_start, with_duration
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array


def functions_of(statement: Statement) -> ProblemFunctions:
    """Compile the functions of a statement.

    Raises ProblemError, with the name of what is missing or contradicts itself.
    """
    name = statement.name
    if missing := [v.name for v in statement.states if v.name not in statement.rates]:
        raise ProblemError(f"{name}: no dynamics for {', '.join(missing)}; allowed: one for each state")
    if statement.duration is None:
        raise ProblemError(f"{name}: no duration is given; allowed: duration() or free_duration()")
    s = with_duration(since_start(statement))
    rates = ca.vertcat(*(s.rates[v.name] for v in s.states))
    guess = guesses_of(s)
    initial, final = without_repetitions(s)
    s = dataclasses.replace(s, initial=initial, final=final)
    check_equations(s, guess.states, guess.state_scale, _nominal(s))
    return ProblemFunctions(
        name=name,
        states=tuple(v.name for v in s.states),
        controls=tuple(v.name for v in s.controls),
        parameters=tuple(each.name for each in s.parameters),
        dynamics=_function(s, "f", s.along, rates, "dynamics"),
        running_cost=_function(s, "L", s.along, s.running, "running cost"),
        terminal_cost=_function(s, "Psi", s.at_end, s.terminal, "terminal cost"),
        path=_function(s, "d", s.along, _column(s.path), "path constraints"),
        initial=_function(s, "i", s.at_start, _column(s.initial), "start"),
        final=_function(s, "s", s.at_end, _column(s.final), "end"),
        state_bounds=bounds(s.states),
        control_bounds=without_implied(bounds(s.controls), s.path, s.u),
        path_bounds=limits(s.path),
        initial_bounds=limits(s.initial),
        final_bounds=limits(s.final),
        path_names=tuple(row.name for row in s.path),
        initial_names=tuple(row.name for row in s.initial),
        final_names=tuple(row.name for row in s.final),
        duration_bounds=(statement.duration.lower, statement.duration.upper),
        state_scale=guess.state_scale,
        control_scale=guess.control_scale,
        nominal=_nominal(s),
        guess_times=guess.times,
        guess_states=guess.states,
        guess_controls=guess.controls,
        guess_duration=statement.duration.guess,
        breaks=break_fractions(s),
        instants=instant_functions(s),
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Guesses:
    """All guesses at the union of their break times, and the scales of the variables."""

    times: Array  # (k,) fractions of T
    states: Array  # (k, nx)
    controls: Array  # (k, nu)
    state_scales: list[Scale]  # nx
    control_scales: list[Scale]  # nu

    @property
    def state_scale(self) -> Array:
        """(nx,) values."""
        return _values(self.state_scales)

    @property
    def control_scale(self) -> Array:
        """(nu,) values."""
        return _values(self.control_scales)


def guesses_of(statement: Statement) -> Guesses:
    """Guesses and scales of a statement whose duration is given; ProblemError for a simulation that diverges."""
    assert statement.duration is not None
    duration = statement.duration.guess
    variables = [*statement.states, *statement.controls]
    times = np.unique(np.concatenate([v.guess.breaks(duration) for v in variables]))
    if statement.simulation is not None:
        times = np.union1d(times, np.linspace(0.0, 1.0, SAMPLES))

    def spread(over: list[Variable]) -> Array:
        columns = [v.guess.at(times, duration) for v in over]
        return np.array(columns).T.reshape(len(times), len(over))

    x, u, p = spread(statement.states), spread(statement.controls), _nominal(statement)
    _derive(statement, times * duration, x, u, p)
    if statement.simulation is not None:
        rates = ca.Function("f", statement.along, [column(statement.rates[v.name] for v in statement.states)])
        start = _start(statement, x[0])
        before, _ = variable_scales(statement, times * duration, x, u, p)
        x = simulated(statement.name, rates, _values(before), start, times * duration, u, p)
    return Guesses(times, x, u, *variable_scales(statement, times * duration, x, u, p))


def _values(scales: list[Scale]) -> Array:
    return np.array([scale.value for scale in scales], float)


def _derive(statement: Statement, times: Array, x: Array, u: Array, p: Array) -> None:
    """Fill in the guesses that follow from others, in the order of their declaration."""
    names = [v.name for v in statement.states]
    for k, variable in enumerate(statement.states):
        guess = variable.guess
        if not isinstance(guess, Derived):
            continue
        if guess.start_of:
            x[:, k] = value_of(statement.starts.get(guess.start_of), x[0, names.index(guess.start_of)])
        else:
            x[:, k] = integral(statement.rates[variable.name], statement.along, times, x, u, p)


def value_of(stated: ca.SX | None, otherwise: float) -> float:
    """A stated value if it is a number, otherwise ``otherwise``."""
    return float(stated) if stated is not None and stated.is_constant() else float(otherwise)


def _start(statement: Statement, guess: Array) -> Array:
    """States (nx,) from which a simulation begins."""
    assert statement.simulation is not None
    given = statement.simulation.start
    return np.array(
        [
            given[v.name] if v.name in given else value_of(statement.starts.get(v.name), value)
            for v, value in zip(statement.states, guess, strict=True)
        ]
    )


def _nominal(statement: Statement) -> Array:
    return np.array([each.nominal for each in statement.parameters], float)


def _column(rows: list[Row]) -> ca.SX:
    return column(row.expression for row in rows)


def _function(s: Statement, name: str, arguments: list[ca.SX], result: ca.SX, what: str) -> ca.Function:
    check_symbols(f"{s.name}: the {what}", result, ca.vertcat(*arguments))
    return ca.Function(name, arguments, [result])
