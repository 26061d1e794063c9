"""Elastic mode: search for the constraints of an infeasible programme that cannot hold together.

    minimise Σ w_i (s+_i + s-_i)    subject to    lower <= g(x, p) - s+ + s- <= upper,   s+, s- >= 0,

and the bounds on x unchanged. Rows that are violated in the solution, and rows and bounds that have a multiplier,
contradict each other: without any of them the violation would be less (Farkas). The equations of the dynamics weigh
most, then the start, the path and the end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.layout import bounded_states
from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.nlp_solver import NlpSolver, SolverOutcome, ipopt_settings

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
