"""Bound on the cost of a smooth solution above its least value, from the stationarity of its Hamiltonian.

Applied to the dynamics, a control u that differs by δu from the best one costs, to second order,

    J(u) - J* = 1/2 ∫ δu' H_uu δu dt,        δu = -H_uu^-1 (H_u(x, u, λ) + f_u' δλ),

H = L + λ'f. At the points of a collocation scheme H_u vanishes; between them it shows what the control's polynomial
leaves out. δλ is the error of the costates, at most the sum of the defects,

    a_i = λ_i - λ_{i+1} - ∫ H_x dt,

over the intervals. It needs a problem whose controls H_uu > 0 determines, and a solution on which no limit is active.
"""

from __future__ import annotations

import math
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.scaling_rows import with_ordinary_rows
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_integral_weights, interval_weights

_POINTS = 5  # Gauss points of an interval
_FELT = 1e-6  # share of |J| that a limit's multiplier has where it holds back
_CONVEX = 1e-9  # least eigenvalue of H_uu over its largest along the solution


def suboptimality(solution: Solution) -> float:
    """Estimate of J - J*, in units of J.

    Infinite where a limit is active, H_uu does not determine a control, or costates jump at given times.
    """
    problem, scheme, d = solution.problem, solution.scheme, np.diff(solution.t)
    if not problem.nu or len(scheme.points) < 2 or problem.instants is not None or _restrained(solution):
        return math.inf
    abscissae, share = gauss_legendre(_POINTS)
    c, b = 0.5 * (abscissae + 1.0), 0.5 * share
    basis, steps = interval_weights(scheme, c), interval_integral_weights(scheme, c)
    t = (solution.t[:-1, None] + c * d[:, None]).ravel()
    x = solution.x[:-1, None, :] + d[:, None, None] * (steps @ solution.rates)
    u, costate = basis @ solution.u, basis @ solution.multipliers.dynamics.values
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    arguments = (x.reshape(len(t), -1).T, u.reshape(len(t), -1).T, t[None, :], p, costate.reshape(len(t), -1).T)
    values = _derivatives(problem).map(len(t))(*arguments)
    by_state, by_control, curvature, transfer = (np.array(value.full()).T for value in values)
    nx, nu = problem.nx, problem.nu
    H_uu = curvature.reshape(-1, nu, nu)
    if not np.isfinite(H_uu).all():
        return math.inf
    eigenvalues = np.linalg.eigvalsh(H_uu)
    if eigenvalues.min() <= _CONVEX * eigenvalues.max():
        return math.inf
    gathered = d[:, None] * np.einsum("g,ngm->nm", b, by_state.reshape(len(d), -1, nx))
    ends = np.vstack([solution.costates[1:], solution.multipliers.dynamics.values[-1, -1]])
    error = np.abs(solution.costates - ends - gathered).sum(axis=0)
    slope = np.abs(by_control) + np.abs(transfer.reshape(-1, nx, nu)).transpose(0, 2, 1) @ error
    excess = 0.5 * np.einsum("nk,nk->n", slope, np.linalg.solve(H_uu, slope[..., None])[..., 0])
    return float((d * (excess.reshape(len(d), -1) @ b)).sum())


def _restrained(solution: Solution) -> bool:
    """True if a limit on the path is active somewhere."""
    solution = with_ordinary_rows(solution)
    problem, multipliers, shares = solution.problem, solution.multipliers, solution.point_shares[:, :, None]
    least = _FELT * max(abs(solution.cost), _FELT)
    return any(
        (np.abs(values) * shares * scale).max(initial=0.0) > least
        for values, scale in (
            (multipliers.path.values, 1.0),
            (multipliers.states.values, problem.state_scale),
            (multipliers.controls.values, problem.control_scale),
        )
    )


@lru_cache(maxsize=64)
def _derivatives(problem: ProblemFunctions) -> ca.Function:
    """(x, u, t, p, λ) -> H_x (nx,), H_u (nu,), H_uu (nu nu,) and f_u (nx nu,), row by row."""
    x, u, t, p = problem.dynamics.sx_in()
    costate = ca.SX.sym("lambda", problem.nx)
    f = problem.dynamics(x, u, t, p)
    hamiltonian = problem.running_cost(x, u, t, p) + ca.dot(costate, f)
    H_uu, H_u = ca.hessian(hamiltonian, u)
    results = [ca.gradient(hamiltonian, x), H_u, ca.vec(H_uu), ca.vec(ca.jacobian(f, u).T)]
    return ca.Function("derivatives", [x, u, t, p, costate], [ca.densify(each) for each in results])
