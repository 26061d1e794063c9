"""Reasons of a solve that failed: functions that are not finite, an unbounded problem, constraints that conflict.

**Elastic mode**: search for the constraints of an infeasible programme that cannot hold together.

    minimise Σ w_i (s+_i + s-_i)    subject to    lower <= g(x, p) - s+ + s- <= upper,   s+, s- >= 0,

and the bounds on x unchanged. Rows that are violated in the solution, and rows and bounds that have a multiplier,
contradict each other: without any of them the violation would be less (Farkas). The equations of the dynamics weigh
most, then the start, the path and the end.

**Unbounded problem**: a final time at a limit that was not stated, or a value that ran away.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.layout import bounded_states
from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.controllers.ocp.problem_functions import DURATION_LIMITS, ProblemFunctions
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.nlp_solver import NlpSolver, SolverOutcome, ipopt_settings


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


_WEIGHTS = {"dynamics": 100.0, "start": 10.0, "path": 2.0, "end": 1.0}
"""weights of rows by the first word of their labels: with an end out of reach, start and dynamics are meant to hold"""

_VIOLATED, _HELD = 1e-6, 1e-3  # least violation, and least multiplier over the weight of a row, that count
_MOST = 6  # constraints that are named
_ITERATIONS, _SECONDS = 200, 60.0


def contradiction(nlp: Programme, x_0: Array, known: Array) -> str:
    """Constraints that contradict each other near the scaled unknowns x_0 (n,), for known values; empty if none do.

    Also empty where the elastic programme was not solved.
    """
    n, m = nlp.x.numel(), len(nlp.lower)
    labels = _row_labels(nlp)
    weights = np.array([_WEIGHTS.get(re.split(r"\W", label)[0], 2.0) if label else 100.0 for label in labels])
    solver = _elastic(nlp, weights)
    given = solver.inputs
    g = ca.Function("g", [nlp.x, nlp.p], [nlp.assembly.g])(x_0, known).full()[:, 0]
    slacks = np.concatenate([np.maximum(g - nlp.upper, 0.0), np.maximum(nlp.lower - g, 0.0)])
    given["x0"][:], given["p"][:] = np.concatenate([x_0, slacks]), known
    given["lbg"][:], given["ubg"][:] = nlp.lower, nlp.upper
    given["lbx"][:], given["ubx"][:] = 0.0, np.inf
    given["lbx"][:n], given["ubx"][:n] = nlp.x_lower, nlp.x_upper
    if solver.solve().outcome is not SolverOutcome.CONVERGED:
        return ""
    x, rows, bounds = (solver.outputs[name] for name in ("x", "lam_g", "lam_x"))
    violation = x[n : n + m] - x[n + m :]
    violated = _largest(labels, np.abs(violation), _VIOLATED)
    if not violated:
        return ""
    shown = [f"{label} (violated by {amount:.2g})" for label, amount in violated.items()]
    held = [label for label in _largest(labels, np.abs(rows) / weights, _HELD) if label not in violated]
    limits = _largest(_bound_labels(nlp, bounds[:n]), np.abs(bounds[:n]), _HELD)
    every = dict.fromkeys((*held, *limits))
    others = [label for label in every if not label.startswith("dynamics")][:_MOST]
    return f"{'; '.join(shown[:_MOST])}: cannot hold with {'; '.join(others) if others else 'the dynamics'}"


def _elastic(nlp: Programme, weights: Array) -> NlpSolver:
    """The solver of the elastic programme, unknowns x, s+ and s-."""
    n, m = nlp.x.numel(), len(nlp.lower)
    every, mu, sigma = ca.MX.sym("elastic", n + 2 * m), ca.MX.sym("lam_g", m), ca.MX.sym("lam_f")
    x, one = every[:n], ca.DM.eye(m)
    own = nlp.assembly.derivatives("ipopt")
    g, jacobian = own["nlp_jac_g"](x, nlp.p)
    g = g - every[n : n + m] + every[n + m :]
    weigh = ca.DM(np.concatenate([np.zeros(n), weights, weights]))
    f = ca.dot(weigh, every)
    empty = ca.MX(ca.Sparsity(2 * m, 2 * m))
    hessian = ca.diagcat(own["nlp_hess_l"](x, nlp.p, 0.0, mu), empty)
    known, names = [every, nlp.p], ["x", "p"]
    cache = (
        ca.Function("nlp_grad_f", known, [f, weigh], names, ["f", "grad_f_x"]),
        ca.Function("nlp_jac_g", known, [g, ca.horzcat(jacobian, -one, one)], names, ["g", "jac_g_x"]),
        ca.Function("nlp_hess_l", [*known, sigma, mu], [hessian], [*names, "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]),
    )
    return NlpSolver(
        "elastic", "ipopt", {"x": every, "p": nlp.p, "f": f, "g": g},
        {"show_eval_warnings": False, **ipopt_settings(1e-8, _ITERATIONS, {})},
        ("x", "lam_g", "lam_x"), seconds=_SECONDS, cache={each.name(): each for each in cache},
    )  # fmt: skip


def _largest(labels: Sequence[str], values: Array, least: float) -> dict[str, float]:
    """The largest value of each label, from the largest on, where it is at least ``least``."""
    found: dict[str, float] = {}
    for i in np.argsort(-values, kind="stable"):
        if not values[i] >= least:
            break
        if labels[i]:
            found.setdefault(labels[i], float(values[i]))
    return found


def _row_labels(nlp: Programme) -> list[str]:
    """A label (m,) for every row; empty for those of the nodes and of constants."""
    problem, layout = nlp.layout.problem, nlp.layout
    labels = [""] * len(nlp.lower)
    nd, dynamics = len(problem.path_bounds.lower), [f"dynamics of {name}" for name in problem.states]
    path = [f"path: {text}" for text in _limited(problem.path_names, *problem.path_bounds)]
    limits = _limited(problem.states, *problem.state_bounds)
    between = [limits[i] for i in bounded_states(problem)]
    hidden = max(0, len(layout.scheme.points) - 2) if layout.scheme.interior == 0 else 0
    along = path * layout.own_points + between * hidden

    def label(rows: Integers, names: Sequence[str]) -> None:
        for row, name in zip(rows.tolist(), names, strict=False):
            if row >= 0:
                labels[row] = name

    for start, inner, held in zip(nlp.gap_start, nlp.inner_rows, nlp.held_rows, strict=True):
        label(start + np.arange(problem.nx), dynamics)
        label(inner, dynamics * layout.scheme.interior)
        label(held, along)
    label(nlp.initial_rows, _at("start", _limited(problem.initial_names, *problem.initial_bounds)))
    ends = _at("end", _limited(problem.final_names, *problem.final_bounds))
    label(nlp.final_rows, ends + (path if len(nlp.final_rows) == len(ends) + nd else []))
    if problem.instants is not None:
        label(nlp.instant_rows, _limited(problem.instants.names, *problem.instants.bounds))
    return labels


def _bound_labels(nlp: Programme, multipliers: Array) -> list[str]:
    """Label (n,) of the bound of every unknown, on the side that its multiplier (n,) belongs to."""
    problem, layout = nlp.layout.problem, nlp.layout
    upper = multipliers > 0.0
    names = np.full((2, layout.size), "", dtype=object)
    for side, sign in enumerate((">=", "<=")):
        controls = _texts(problem.controls, sign, problem.control_bounds[side])
        states = _texts(problem.states, sign, problem.state_bounds[side])
        z = states + _texts(("T",) * layout.durations, sign, np.full(layout.durations, problem.duration_bounds[side]))
        z += [""] * (layout.state_size - len(z))
        w = controls * layout.own_points + states * layout.scheme.interior
        w += [""] * (layout.input_size - len(w))
        own = np.tile(np.array(z + w, dtype=object), (layout.nodes - 1, 1))[layout.stage_columns >= 0]
        names[side] = [*own, *z, *(controls if layout.scheme.shared else [])]
    return [str(names[int(above), i]) for i, above in enumerate(upper)]


def _texts(names: Sequence[str], sign: str, limits: Array) -> list[str]:
    return [f"{name} {sign} {limit:g}" for name, limit in zip(names, limits, strict=True)]


def _at(where: str, texts: Sequence[str]) -> list[str]:
    return [text if text.startswith(f"{where} of ") else f"{where}: {text}" for text in texts]


def _limited(names: Sequence[str], lower: Array, upper: Array) -> list[str]:
    """Names of constraints, with their limits unless the text contains them."""
    texts = []
    for name, least, most in zip(names, lower, upper, strict=True):
        if any(sign in name for sign in ("=", "<", ">", " of ")):  # with its limits, or the pinned end of a state
            texts.append(name)
        elif least == most:
            texts.append(f"{name} = {least:g}")
        else:
            below, above = "" if least == -np.inf else f"{least:g} <= ", "" if most == np.inf else f" <= {most:g}"
            texts.append(f"{below}{name}{above}")
    return texts
