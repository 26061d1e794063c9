"""Indirect check (1.1.1): Pontryagin's conditions as a boundary-value problem, started from a direct solution.

With H(x, u, λ, t) = L + λ'f, minimised, and by automatic differentiation throughout,

    x' = f,   λ' = -H_x,   0 = H_u  (or u at its bound),
    i(x(0)) = 0,   λ(0) + i_x' ν_0 = 0,
    s(x(T), T) = 0,   λ(T) = Psi_x + s_x' ν,   and for a free T   H(T) + Psi_T + s_T' ν = 0.

The thesis writes H = λ'f - L, maximised: its λ is minus the one here. Solved by collocation with residual control
(scipy.integrate.solve_bvp); the costates of the direct solution, its multipliers, are the guess. i and s are the end
conditions that hold with equality, each less the limit that holds. Not covered, and refused by name: a path constraint,
a bound of a state or of T that is active, controls in which H is linear, or that are bounded and not separable in it.
What is refused here, ``pontryagin`` judges along the direct solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions, first_line
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_ACTIVE = 1e-6  # scaled distance to a limit that counts as touching it
_NEWTON_STEPS = 8


@dataclass(frozen=True, eq=False)
class IndirectSolution:
    """Solution of the boundary-value problem, on the mesh that its solver chose."""

    converged: bool
    message: str
    duration: float  # [s] T
    t: Array  # (n,) [s]
    x: Array  # (n, nx)
    costates: Array  # (n, nx) λ
    u: Array  # (n, nu)
    residual: float  # largest relative residual of the differential equations
    hamiltonian: Array  # (n,) H; constant where nothing depends on t explicitly


def solve_indirect(solution: Solution, *, tolerance: float = 1e-8, most_nodes: int = 20_000) -> IndirectSolution:
    """Solve Pontryagin's conditions, started from a direct solution and its costates.

    Args:
        solution: a direct solution.
        tolerance: largest relative residual of the differential equations.
        most_nodes: limit of the number of nodes of the mesh.

    Returns:
        The solution of the boundary-value problem; ``converged`` and ``message`` say how it ended.

    Raises:
        ProblemError: for a direct solution that failed and for a problem that these conditions do not cover.
    """
    if not isinstance(solution, Solution):
        raise ProblemError(f"solution = {first_line(solution)}; allowed: a direct Solution")
    if not solution.solved:
        raise ProblemError(f"the direct solution of {solution.problem.name} failed: {solution.status.value}")
    if solution.problem.instants is not None:
        raise ProblemError(f"{solution.problem.name}: at() makes costates jump; allowed: problems without")
    _check_covered(solution)
    problem, p = solution.problem, solution.parameters
    nx, scale, u_scale = problem.nx, problem.state_scale, problem.control_scale
    ends = _active_ends(solution)
    system = _pontryagin(problem)
    conditions = _conditions(problem, *ends)
    tau = np.unique(np.concatenate([solution.grid.nodes, 0.5 * (solution.grid.nodes[1:] + solution.grid.nodes[:-1])]))
    known = solution.costate_times / solution.duration
    costates = np.array([np.interp(tau, known, column) for column in (solution.costates * scale).T])
    y = np.vstack([solution.state(tau * solution.duration).T / scale[:, None], costates])
    free = int(problem.free_duration)
    multipliers = np.zeros(sum(len(end.rows) for end in ends))
    unknown = np.concatenate([[solution.duration] * free, multipliers])

    def duration(k: Array) -> float:
        return float(k[0]) if free else solution.duration

    def control_guess(tau: Array) -> Array:
        return np.array(solution.control(tau * solution.duration).T / u_scale[:, None])

    def rates(tau: Array, y: Array, k: Array) -> Array:
        out = system.map(len(tau))(y, control_guess(tau), tau[None, :], duration(k), p)[0]
        return np.array(out.full())

    def boundary(y_0: Array, y_1: Array, k: Array) -> Array:
        controls = [control_guess(np.array([at])) for at in (0.0, 1.0)]
        return np.array(conditions(y_0, y_1, controls[1], duration(k), k[free:], p).full()[:, 0])

    # The multipliers enter linearly: their guess is the least-squares one.
    base = boundary(y[:, 0], y[:, -1], unknown)
    slopes = np.array([boundary(y[:, 0], y[:, -1], unknown + e) - base for e in np.eye(len(unknown))[free:]]).T
    if slopes.size:
        unknown[free:] = np.linalg.lstsq(slopes, -base, rcond=None)[0]
    found = solve_bvp(rates, boundary, tau, y, unknown, tol=tolerance, max_nodes=most_nodes)
    final = duration(found.p) if found.p is not None else solution.duration
    values = system.map(len(found.x))(found.y, control_guess(found.x), found.x[None, :], final, p)
    return IndirectSolution(
        converged=bool(found.success),
        message=str(found.message),
        duration=final,
        t=found.x * final,
        x=(found.y[:nx] * scale[:, None]).T,
        costates=(found.y[nx:] / scale[:, None]).T,
        u=values[1].full().T * u_scale,
        residual=float(np.max(found.rms_residuals)),
        hamiltonian=values[2].full()[0],
    )


def _check_covered(solution: Solution) -> None:
    problem = solution.problem
    touched = _touched(solution.x, problem.state_bounds, problem.state_scale)
    for row, ends in ((0, problem.initial), (-1, problem.final)):  # an end condition may put a state on its bound
        touched[row, _pinned(ends, problem.nx)] = False
    active = {
        "the bound of a state": touched,
        "a path constraint": _touched(_path_values(solution), problem.path_bounds, 1.0),
    }
    if problem.free_duration:
        shortest, longest = (np.array([bound]) for bound in problem.duration_bounds)
        active["the bound of T"] = _touched(np.array([solution.duration]), Interval(shortest, longest), shortest)
    for name, there in active.items():
        if there.any():
            raise ProblemError(f"{problem.name}: {name} is active; allowed: problems without, for the indirect check")


def _touched(values: Array, limits: Interval, scale: Array | float) -> NDArray[np.bool_]:
    return (values - limits.lower <= _ACTIVE * scale) | (limits.upper - values <= _ACTIVE * scale)


def _pinned(ends: ca.Function, nx: int) -> NDArray[np.bool_]:
    """(nx,) True for states that have an end condition to themselves."""
    depends = np.array(ca.DM(ends.jac_sparsity(0, 0), 1.0).full(), bool).reshape(-1, nx)
    return np.asarray(depends[depends.sum(axis=1) == 1].any(axis=0))


def _path_values(solution: Solution) -> Array:
    problem = solution.problem
    if not len(problem.path_bounds.lower):
        return np.empty((0, 0))
    t = solution.t
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    return np.array(problem.path.map(len(t))(solution.x.T, solution.control(t).T, t[None, :], p).full().T)


class _Ends(NamedTuple):
    """Rows of i or s that hold with equality, and the limit of each."""

    rows: tuple[int, ...]
    limits: tuple[float, ...]


def _active_ends(solution: Solution) -> tuple[_Ends, _Ends]:
    """The conditions at the start and at the end that hold with equality."""
    problem, p = solution.problem, solution.parameters
    initial = problem.initial(solution.x[0], p).full()[:, 0]
    final = problem.final(solution.x[-1], solution.duration, p).full()[:, 0]
    ends = []
    for values, (lower, upper) in ((initial, problem.initial_bounds), (final, problem.final_bounds)):
        limits = np.where(values - lower <= _ACTIVE, lower, upper)
        rows = np.flatnonzero((values - lower <= _ACTIVE) | (upper - values <= _ACTIVE))
        ends.append(_Ends(tuple(rows.tolist()), tuple(limits[rows].tolist())))
    return ends[0], ends[1]


@dataclass(frozen=True, eq=False)
class _Symbols:
    """Scaled states and costates, and expressions of them."""

    y: ca.SX  # (2 nx,) x / S and S λ
    x: ca.SX
    costate: ca.SX
    u: ca.SX
    t: ca.SX
    p: ca.SX
    hamiltonian: ca.SX


def _symbols(problem: ProblemFunctions) -> _Symbols:
    nx = problem.nx
    y, u, t, p = (
        ca.SX.sym("y", 2 * nx),
        ca.SX.sym("u", problem.nu),
        ca.SX.sym("t"),
        ca.SX.sym("p", len(problem.parameters)),
    )
    x, costate = y[:nx] * problem.state_scale, y[nx:] / problem.state_scale
    scaled = u * problem.control_scale
    hamiltonian = problem.running_cost(x, scaled, t, p) + ca.dot(costate, problem.dynamics(x, scaled, t, p))
    return _Symbols(y, x, costate, u, t, p, hamiltonian)


@lru_cache(maxsize=16)
def _pontryagin(problem: ProblemFunctions) -> ca.Function:
    """(y, u_guess, τ, T, p) -> dy/dτ, u / u_scale, H."""
    s = _symbols(problem)
    guess, tau, duration = ca.SX.sym("u_guess", problem.nu), ca.SX.sym("tau"), ca.SX.sym("T")
    gradient = ca.gradient(s.hamiltonian, s.u)
    curvature = ca.jacobian(gradient, s.u)
    lower, upper = (bound / problem.control_scale for bound in problem.control_bounds)
    bounded = bool(np.isfinite(lower).any() or np.isfinite(upper).any())
    if bounded and not ca.simplify(curvature - ca.diag(ca.diag(curvature))).is_zero():
        raise ProblemError(f"{problem.name}: the Hamiltonian is not separable in its bounded controls")
    if problem.nu and ca.simplify(curvature).is_zero():
        raise ProblemError(f"{problem.name}: the Hamiltonian is linear in the controls; allowed: a regular one")
    newton = ca.Function("newton", [s.u, s.y, s.t, s.p], [s.u - ca.solve(curvature, gradient)])
    u = guess
    linear = not ca.depends_on(curvature, s.u)
    for _ in range(1 if linear else _NEWTON_STEPS):  # a quadratic Hamiltonian is done in one
        u = newton(u, s.y, s.t, s.p)
    if bounded:
        u = ca.fmin(ca.fmax(u, lower), upper)
    slope = ca.gradient(s.hamiltonian, s.y)  # (H_x S, H_λ / S): the scales cancel
    nx = problem.nx
    flow = ca.Function("flow", [s.y, s.u, s.t, s.p], [ca.vertcat(slope[nx:], -slope[:nx]), s.hamiltonian])
    rates, hamiltonian = flow(s.y, u, tau * duration, s.p)
    optimal = ca.substitute(u, s.t, tau * duration)
    rates, hamiltonian = (ca.substitute(e, s.t, tau * duration) for e in (rates, hamiltonian))
    return ca.Function("pontryagin", [s.y, guess, tau, duration, s.p], [duration * rates, optimal, hamiltonian])


@lru_cache(maxsize=16)
def _conditions(problem: ProblemFunctions, initial: _Ends, final: _Ends) -> ca.Function:
    """(y(0), y(T), u_guess(T), T, ν, p) -> the boundary conditions."""
    nx, scale = problem.nx, problem.state_scale
    y_0, y_1, guess = ca.SX.sym("y_0", 2 * nx), ca.SX.sym("y_1", 2 * nx), ca.SX.sym("u", problem.nu)
    duration, p = ca.SX.sym("T"), ca.SX.sym("p", len(problem.parameters))
    nu_0, nu_1 = ca.SX.sym("nu_0", len(initial.rows)), ca.SX.sym("nu_1", len(final.rows))
    x_0, x_1 = y_0[:nx] * scale, y_1[:nx] * scale
    start = problem.initial(x_0, p)[list(initial.rows)] - ca.DM(initial.limits) if initial.rows else ca.SX(0, 1)
    end = problem.final(x_1, duration, p)[list(final.rows)] - ca.DM(final.limits) if final.rows else ca.SX(0, 1)
    bolza = problem.terminal_cost(x_1, duration, p) + ca.dot(nu_1, end)
    rows = [start, y_0[nx:] + ca.gradient(ca.dot(nu_0, start), y_0)[:nx], end, y_1[nx:] - ca.gradient(bolza, y_1)[:nx]]
    if problem.free_duration:
        hamiltonian = _pontryagin(problem)(y_1, guess, 1.0, duration, p)[2]
        rows.append(hamiltonian + ca.gradient(bolza, duration))
    return ca.Function("conditions", [y_0, y_1, guess, duration, ca.vertcat(nu_0, nu_1), p], [ca.vertcat(*rows)])
