"""Reasons of a solve that failed: functions that are not finite, and an unbounded problem.

A problem is unbounded where a final time ends at a limit that was not stated, or a value ran away. Constraints that
conflict are the subject of ``feasibility``.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import DURATION_LIMITS, ProblemFunctions
from mathnavi.interfaces.signals import Array


def not_finite(problem: ProblemFunctions, x: Array, u: Array, t: Array, p: Array, iterate: str = "guess") -> str:
    """The first value that is not finite along states (n, nx), controls (n, nu) at times (n,) [s], in words.

    Parameters p (np,) come first, then what holds along the path, in the order of time, then both ends, then the
    derivatives by states and controls of what holds along the path. Empty where all are finite. ``iterate`` is the name
    of the iterate that x, u and t belong to.
    """
    if strange := [f"{name} = {value}" for name, value in zip(problem.parameters, p, strict=True) if _strange(value)]:
        return f"parameter {strange[0]}"
    along = (
        ("dynamics of", problem.dynamics, problem.states),
        ("running cost", problem.running_cost, ("",)),
        ("path constraint", problem.path, problem.path_names),
    )
    for state, control, now in zip(x, u, t, strict=True):
        where = f"t = {now:g} s of the {iterate}, where {_values(problem, state, control)}"
        for what, function, names in along:
            if found := _first(what, function, names, (state, control, now, p)):
                return f"{found} at {where}"
    ends = (
        ("terminal cost", problem.terminal_cost, ("",), (x[-1], t[-1], p)),
        ("start constraint", problem.initial, problem.initial_names, (x[0], p)),
        ("end constraint", problem.final, problem.final_names, (x[-1], t[-1], p)),
    )
    for what, function, names, arguments in ends:
        if found := _first(what, function, names, arguments):
            return f"{found} for the {iterate}"
    return _steep(problem, along, (x, u, t, p), iterate)


def _steep(
    problem: ProblemFunctions,
    along: tuple[tuple[str, ca.Function, Sequence[str]], ...],
    values: tuple[Array, Array, Array, Array],
    iterate: str,
) -> str:
    """The first derivative by states and controls that is not finite."""
    x, u, t, p = values
    variables = (*problem.states, *problem.controls)
    for what, function, names in along:
        arguments = function.sx_in()
        slopes = ca.jacobian(function(*arguments), ca.vertcat(arguments[0], arguments[1]))
        slope = ca.Function("slope", arguments, [slopes])
        for state, control, now in zip(x, u, t, strict=True):
            strange = np.argwhere(~np.isfinite(slope(state, control, now, p).full()))
            if len(strange):
                i, j = strange[0]
                where = f"t = {now:g} s of the {iterate}, where {_values(problem, state, control)}"
                named = " ".join(filter(None, (what, names[i])))
                return f"the derivative of the {named} by {variables[j]} is not finite at {where}"
    return ""


def _first(what: str, function: ca.Function, names: Sequence[str], arguments: tuple[Array | float, ...]) -> str:
    values = function(*arguments).full()[:, 0]
    for name, value in zip(names, values, strict=True):
        if _strange(value):
            verb = "are" if what.startswith("dynamics") else "is"
            return f"{' '.join(filter(None, (what, name)))} {verb} {value}"
    return ""


def _strange(value: float) -> bool:
    return not np.isfinite(value)


def _values(problem: ProblemFunctions, x: Array, u: Array) -> str:
    pairs = zip((*problem.states, *problem.controls), (*x, *u), strict=True)
    return ", ".join(f"{name} = {value:.4g}" for name, value in pairs)


HUGE = 1e8
"""factor over its scale, or the largest of its guess and its limits, above which a value ran away"""

_AT_LIMIT = 1e-3  # relative distance


def unbounded(problem: ProblemFunctions, x: Array, u: Array, duration: float, *, diverged: bool) -> str:
    """Message with the variables of a last iterate that are unbounded; empty if all are bounded.

    A state follows from controls and T: where these keep within limits, a large state is the problem's own, unless the
    solver ``diverged``.

    Args:
        problem: the problem.
        x: (n, nx) states.
        u: (m, nu) controls.
        duration: [s] T.
        diverged: True if the solver itself found that its iterates run away.
    """
    durations = [("T", duration, problem.duration_bounds, problem.guess_duration)] if problem.free_duration else []
    for i, name in enumerate(problem.states):  # of phases
        if name.endswith(".duration"):
            limits = float(problem.state_bounds.lower[i]), float(problem.state_bounds.upper[i])
            durations.append((name, float(x[0, i]), limits, float(problem.state_scale[i])))
    found = [_duration(*each) for each in durations]
    found += _running_away(problem.controls, u, problem.control_scale, problem.guess_controls, problem.control_bounds)
    if diverged or any(found):
        found += _running_away(problem.states, x, problem.state_scale, problem.guess_states, problem.state_bounds)
    return "; ".join(filter(None, found))


def _duration(label: str, duration: float, limits: tuple[float, float], typical: float) -> str:
    for name, limit, default in zip(("lower", "upper"), limits, DURATION_LIMITS, strict=True):
        if limit == default and abs(duration - limit) <= _AT_LIMIT * limit:
            return f"{label} ends at {limit:g} s, its default {name} limit; state one, or a cost that bounds it"
    if limits[1] == DURATION_LIMITS[1] and duration > HUGE * typical:
        return f"{label} runs to {duration:.2g} s; state an upper limit, or a cost that bounds it"
    return ""


def _running_away(
    names: tuple[str, ...], values: Array, scale: Array, guess: Array, bounds: tuple[Array, Array]
) -> list[str]:
    known = np.vstack([scale, np.abs(guess), *(np.where(np.isfinite(b), np.abs(b), 0.0) for b in bounds)]).max(axis=0)
    largest = np.abs(values).max(axis=0, initial=0.0)
    return [
        f"{name} runs to {values[np.abs(values[:, i]).argmax(), i]:.2g}; state a limit, or a cost that bounds it"
        for i, name in enumerate(names)
        if largest[i] > HUGE * known[i]  # NaN is reported elsewhere
    ]
