"""Gaps of a solution's switching functions: what an interval costs because a switch lies inside of it.

A control that enters linearly, H_u = σ(t), is best at the limit against σ. A mesh whose interval contains a zero of σ
has to take a value between the limits there, which costs to first order

    g_i = ∫ Σ_j σ_j (u_j - v_j) dt,        v_j the lower limit where σ_j > 0, the upper one where σ_j < 0,

and fails in no equation of the programme: its replay is exact. On a singular arc σ = 0, and so is g.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.structure import linear_controls
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_integral_weights, interval_weights
from mathnavi.interfaces.signals import Array

_POINTS = 5  # Gauss points of an interval
_JUMP = 1e-2  # of a control's range


def switching_gaps(solution: Solution) -> Array:
    """Gaps g (N - 1,), in units of J, of linear controls with two limits that no path constraint depends on."""
    problem, scheme, d = solution.problem, solution.scheme, np.diff(solution.t)
    lower, upper = problem.control_bounds
    judged = linear_controls(problem) & np.isfinite(lower) & np.isfinite(upper)
    judged[sorted(set(problem.path.jac_sparsity(0, 1).get_col()))] = False
    if not judged.any():
        return np.zeros(len(d))
    abscissae, share = gauss_legendre(_POINTS)
    c, b = 0.5 * (abscissae + 1.0), 0.5 * share
    basis, steps = interval_weights(scheme, c), interval_integral_weights(scheme, c)
    t = (solution.t[:-1, None] + c * d[:, None]).ravel()
    x = (solution.x[:-1, None, :] + d[:, None, None] * (steps @ solution.rates)).reshape(len(t), -1)
    u = np.clip(basis @ solution.u, lower, upper).reshape(len(t), -1)
    costate = (basis @ solution.multipliers.dynamics.values).reshape(len(t), -1)
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    sigma = np.array(_switching(problem).map(len(t))(x.T, u.T, t[None, :], p, costate.T).full().T)
    cost = np.where(judged, sigma * (u - np.where(sigma > 0.0, lower, upper)), 0.0).sum(axis=1)
    gaps: Array = d * (cost.reshape(len(d), -1) @ b)
    return gaps


def switches_at_nodes(solution: Solution) -> Array:
    """Fractions (k,) of T of the nodes at which a linear control with two limits jumps."""
    problem = solution.problem
    lower, upper = problem.control_bounds
    judged = linear_controls(problem) & np.isfinite(lower) & np.isfinite(upper) & (lower < upper)
    jump = np.abs(solution.u[1:, 0] - solution.u[:-1, -1])[:, judged] / (upper - lower)[judged]
    found: Array = solution.grid.nodes[1:-1][jump.max(axis=1, initial=0.0) > _JUMP]
    return found


@lru_cache(maxsize=64)
def _switching(problem: ProblemFunctions) -> ca.Function:
    """(x, u, t, p, λ) -> H_u (nu,)."""
    x, u, t, p = problem.dynamics.sx_in()
    costate = ca.SX.sym("lambda", problem.nx)
    hamiltonian = problem.running_cost(x, u, t, p) + ca.dot(costate, problem.dynamics(x, u, t, p))
    return ca.Function("sigma", [x, u, t, p, costate], [ca.densify(ca.gradient(hamiltonian, u))])
