"""Elastic mode: the constraints of a programme that cannot hold together near an iterate.

    minimise Σ w_i (s+_i + s-_i)    subject to    lower <= g(x, p) - s+ + s- <= upper,   s+, s- >= 0,

and the bounds on x unchanged. Rows that are violated in the solution, and rows and bounds that have a multiplier,
contradict each other there: without any of them the violation would be less (Farkas). The equations of the dynamics
weigh most, then the start, the path and the end. Of a programme that is not convex another iterate may be feasible.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.call import watch
from mathnavi.controllers.ocp.feasibility.labels import bound_labels, row_labels
from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.interfaces.signals import Array
from mathnavi.models.nlp_solver import NlpSolver, SolverOutcome, ipopt_settings

_WEIGHTS = {"dynamics": 100.0, "start": 10.0, "path": 2.0, "end": 1.0}
"""weights of rows by the first word of their labels: with an end out of reach, start and dynamics are meant to hold"""

_VIOLATED, _HELD = 1e-6, 1e-3  # least violation, and least multiplier over the weight of a row, that count
_MOST = 6  # constraints that are named
_ITERATIONS, _SECONDS = 200, 60.0


@dataclass(frozen=True, eq=False)
class Contradiction:
    """Constraints of a programme that contradict each other near an iterate."""

    words: str  # names of the constraints
    violation: float  # Σ w_i |s_i|
    x: Array  # (n,) scaled unknowns of the elastic programme's solution
    multipliers: tuple[Array, Array]  # of the bounds (n,) and of the rows (m,)


def contradiction(nlp: Programme, x_0: Array, known: Array) -> Contradiction | None:
    """Search for constraints that contradict each other near the scaled unknowns x_0 (n,), for known values.

    None where all can hold, and where the elastic programme was not solved.
    """
    n, m = nlp.x.numel(), len(nlp.lower)
    labels = row_labels(nlp)
    weights = np.array([_WEIGHTS.get(re.split(r"\W", label)[0], 2.0) if label else 100.0 for label in labels])
    solver = _elastic(nlp, weights)
    given = solver.inputs
    g = ca.Function("g", [nlp.x, nlp.p], [nlp.assembly.g])(x_0, known).full()[:, 0]
    slacks = np.concatenate([np.maximum(g - nlp.upper, 0.0), np.maximum(nlp.lower - g, 0.0)])
    given["x0"][:], given["p"][:] = np.concatenate([x_0, slacks]), known
    given["lbg"][:], given["ubg"][:] = nlp.lower, nlp.upper
    given["lbx"][:], given["ubx"][:] = 0.0, np.inf
    given["lbx"][:n], given["ubx"][:n] = nlp.x_lower, nlp.x_upper
    if solver.solve(watch(math.nan)).outcome is not SolverOutcome.CONVERGED:
        return None
    x, rows, bounds = (solver.outputs[name] for name in ("x", "lam_g", "lam_x"))
    violation = x[n : n + m] - x[n + m :]
    violated = _largest(labels, np.abs(violation), _VIOLATED)
    if not violated:
        return None
    shown = [f"{label} (violated by {amount:.2g})" for label, amount in violated.items()]
    held = [label for label in _largest(labels, np.abs(rows) / weights, _HELD) if label not in violated]
    limits = _largest(bound_labels(nlp, bounds[:n]), np.abs(bounds[:n]), _HELD)
    every = dict.fromkeys((*held, *limits))
    others = [label for label in every if not label.startswith("dynamics")][:_MOST]
    words = f"{'; '.join(shown[:_MOST])}: cannot hold with {'; '.join(others) if others else 'the dynamics'}"
    return Contradiction(words, float(weights @ np.abs(violation)), x[:n].copy(), (bounds[:n].copy(), rows.copy()))


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
        watched=watch(math.nan) is not None,
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
