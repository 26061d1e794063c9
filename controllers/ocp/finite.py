"""Places where the functions of a problem are not finite: the message of a solve that met NaN or infinity."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
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
