"""A problem of ``mathnavi.controllers.ocp`` by plain collocation in CasADi, as its users write it themselves.

Radau IIA of three points on equal intervals, states and controls as matrices of MX, the points of all intervals mapped
at once, IPOPT. The number of intervals is doubled, each programme started from the solution before, until two J in
succession agree to the tolerance, relative to max(1, |J|): a person without a replay has nothing else to go by. States
and controls are divided by the problem's scales; the guess is the problem's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.ocp_references.collocation import coefficients, radau
from benchmarks.ocp_trajectory import Trajectory
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array

POINTS = radau(3)
FIRST, MOST = 10, 1280  # intervals
IPOPT = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.max_iter": 1000}


@dataclass(frozen=True, eq=False)
class _Found:
    """Solution on equal intervals."""

    cost: float
    duration: float
    states: Array  # (nx, n k + 1) at the start and at all points
    controls: Array  # (nu, n k)


def solved(problem: ProblemFunctions, tolerance: float) -> Trajectory | None:
    """Return the solution whose J has settled to ``tolerance``; None if it does not, or if IPOPT fails."""
    if problem.instants is not None:
        raise ValueError(f"{problem.name}: costs or constraints at given times; allowed: none, of equal intervals")
    before: _Found | None = None
    count = FIRST
    while count <= MOST:
        found = _optimum(problem, count, before, min(1e-8, 0.01 * tolerance))
        if found is None:
            return None
        if before is not None and abs(found.cost - before.cost) <= tolerance * max(1.0, abs(found.cost)):
            return _trajectory(problem, found, count)
        before, count = found, 2 * count
    return None


def _optimum(problem: ProblemFunctions, count: int, guess: _Found | None, tolerance: float) -> _Found | None:
    k, nx, nu = len(POINTS), problem.nx, problem.nu
    A, b = coefficients(POINTS)
    x_scale, u_scale, p = ca.DM(problem.state_scale), ca.DM(problem.control_scale), ca.DM(problem.nominal)
    X, U = ca.MX.sym("X", nx, count * k + 1), ca.MX.sym("U", nu, count * k)
    shortest, longest = problem.duration_bounds
    T_0 = problem.guess_duration if guess is None else guess.duration
    theta = ca.MX.sym("theta")  # T over its guess
    T = theta * T_0
    fractions = np.concatenate([(i + POINTS) / count for i in range(count)])
    x, u, t, own = problem.dynamics.sx_in()
    at = x * x_scale, u * u_scale, t, own
    point = ca.Function(
        "point", [x, u, t, own], [problem.dynamics(*at) / x_scale, problem.running_cost(*at), problem.path(*at)]
    ).map(count * k)
    times, known = ca.DM(fractions[None, :]) * T, ca.repmat(p, 1, count * k)
    rates, running, path = point(X[:, 1:], U, times, known)
    h = T / count
    starts, inner = X[:, :-1:k], X[:, 1:]
    gained = ca.reshape(rates, nx * k, count)  # an interval a column
    increments = ca.kron(ca.DM(A), ca.DM.eye(nx)) @ gained
    defects = ca.repmat(starts, k, 1) + h * increments - ca.reshape(inner, nx * k, count)
    cost = h * (running @ ca.DM(np.tile(b, count)))
    first, last = X[:, 0] * x_scale, X[:, -1] * x_scale
    cost += problem.terminal_cost(last, T, p)
    g = [ca.vec(defects), ca.vec(path), problem.initial(first, p), problem.final(last, T, p)]
    zeros = np.zeros(nx * k * count)
    limits = [
        np.concatenate([zeros, np.tile(side, count * k), i, s])
        for side, i, s in zip(problem.path_bounds, problem.initial_bounds, problem.final_bounds, strict=True)
    ]
    bounds = []
    for xs, us, end in zip(problem.state_bounds, problem.control_bounds, (shortest, longest), strict=True):
        x_side, u_side = xs / problem.state_scale, us / problem.control_scale
        bounds.append(np.concatenate([np.tile(x_side, count * k + 1), np.tile(u_side, count * k), [end / T_0]]))
    x_0, u_0 = _start(problem, fractions, guess)
    w = ca.vertcat(ca.vec(X), ca.vec(U), theta)
    nlp: dict[str, Any] = {"x": w, "f": cost, "g": ca.vertcat(*g)}
    options: dict[str, Any] = IPOPT | {"ipopt.tol": tolerance}
    solver = ca.nlpsol("collocation", "ipopt", nlp, options)
    start = np.concatenate([x_0.ravel("F"), u_0.ravel("F"), [1.0]])
    answer = solver(x0=start, lbx=bounds[0], ubx=bounds[1], lbg=limits[0], ubg=limits[1])
    if not solver.stats()["success"]:
        return None
    values = np.asarray(answer["x"]).ravel()
    states = values[: X.numel()].reshape(-1, nx).T
    controls = values[X.numel() : -1].reshape(-1, nu).T
    return _Found(
        float(answer["f"]), float(values[-1] * T_0), states * problem.state_scale[:, None],
        controls * problem.control_scale[:, None],
    )  # fmt: skip


def _start(problem: ProblemFunctions, fractions: Array, guess: _Found | None) -> tuple[Array, Array]:
    """States (nx, n k + 1) and controls (nu, n k) to start from, over their scales."""
    if guess is None:
        x_at = u_at = problem.guess_times
        x, u = problem.guess_states.T, problem.guess_controls.T
    else:
        count = guess.controls.shape[1] // len(POINTS)
        u_at = np.concatenate([(i + POINTS) / count for i in range(count)])
        x_at, x, u = np.append(0.0, u_at), guess.states, guess.controls

    def read(at: Array, known: Array, rows: Array, scale: Array) -> Array:
        return np.array([np.interp(at, known, row) for row in rows]).reshape(len(rows), len(at)) / scale[:, None]

    states = read(np.append(0.0, fractions), x_at, x, problem.state_scale)
    return states, read(fractions, u_at, u, problem.control_scale)


def _trajectory(problem: ProblemFunctions, found: _Found, count: int) -> Trajectory:
    k = len(POINTS)
    controls = tuple(found.controls[:, i * k : (i + 1) * k].T for i in range(count))
    nodes = np.linspace(0.0, 1.0, count + 1)
    return Trajectory(problem, found.duration, nodes, found.states[:, ::k].T, (POINTS,) * count, controls, found.cost)
