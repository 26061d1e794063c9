"""A problem of ``mathnavi.controllers.ocp`` stated for MAPTOR and solved by ``maptor.solve_adaptive``.

States, controls, end values, path and event constraints of the one phase are stated as in MAPTOR's documentation, with
the expressions inlined into its symbols; mesh and degrees are those of its examples. MAPTOR collocates at
Legendre-Gauss-Radau points and refines by degree and by interval until the relative error of the states, computed with
SciPy's integrator, is below a tolerance; IPOPT in CasADi solves each mesh. States and controls are divided by the
problem's scales; the guess is the problem's.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.ocp_trajectory import Trajectory, control_limits, ends, guess, limits
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions

MESH = (8, 8, 8)  # degrees of the first mesh, and
DEGREES = (3, 8)  # the least and the greatest that refinement may choose, as in its examples
IPOPT = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.max_iter": 1000}


def solved(problem: ProblemFunctions, tolerance: float) -> Trajectory | None:
    """Return the solution to MAPTOR's ``error_tolerance``; None if it did not converge."""
    import maptor
    from maptor.exceptions import MAPTORBaseError

    try:
        found = maptor.solve_adaptive(
            _stated(problem),
            error_tolerance=tolerance,
            min_polynomial_degree=DEGREES[0],
            max_polynomial_degree=DEGREES[1],
            ode_solver_tolerance=0.1 * tolerance,
            nlp_options=IPOPT,
            show_summary=False,
        )
    except MAPTORBaseError as error:  # its way of ending a refinement that fails
        print(f"MAPTOR: {error}", file=sys.stderr)
        return None
    return _trajectory(problem, found) if found.status["success"] else None


def _stated(problem: ProblemFunctions) -> Any:
    import maptor

    stated = maptor.Problem(problem.name)
    phase = stated.set_phase(1)
    shortest, longest = problem.duration_bounds
    time = phase.time(initial=0.0, final=(shortest, longest) if problem.free_duration else shortest)
    start, end = ends(problem)
    states = [
        phase.state(
            f"x{i}", initial=start.fixed.get(i), final=end.fixed.get(i), boundary=None if own == (None, None) else own
        )
        for i, own in enumerate(limits(problem.state_bounds, problem.state_scale))
    ]
    controls = [
        phase.control(f"u{i}", boundary=None if own == (None, None) else own)
        for i, own in enumerate(control_limits(problem))
    ]
    p, scale = ca.DM(problem.nominal), ca.DM(problem.state_scale)
    x = ca.vertcat(*(state() for state in states)) * scale
    u = ca.vertcat(*controls) * ca.DM(problem.control_scale)
    first = ca.vertcat(*(state.initial for state in states)) * scale
    last = ca.vertcat(*(state.final for state in states)) * scale
    rates = _inlined(problem.dynamics, x, u, time(), p) / scale
    phase.dynamics({state: rates[i] for i, state in enumerate(states)})
    for expression, bounds, rows in (
        (_inlined(problem.initial, first, p), problem.initial_bounds, start.others),
        (_inlined(problem.final, last, time.final, p), problem.final_bounds, end.others),
    ):
        for constraint in _constraints(expression, bounds, rows):
            phase.event_constraints(constraint)
    path = _inlined(problem.path, x, u, time(), p)
    for constraint in _constraints(path, problem.path_bounds, tuple(range(path.shape[0]))):
        phase.path_constraints(constraint)
    cost = _inlined(problem.terminal_cost, last, time.final, p)
    running = _inlined(problem.running_cost, x, u, time(), p)
    stated.minimize(cost if running.is_zero() else cost + phase.add_integral(running))
    phase.mesh(list(MESH), np.linspace(-1.0, 1.0, len(MESH) + 1))
    guesses = [
        [guess(problem, (i + np.linspace(0.0, 1.0, degree + more)) / len(MESH))[kind] for i, degree in enumerate(MESH)]
        for kind, more in ((0, 1), (1, 0))
    ]
    phase.guess(states=guesses[0], controls=guesses[1], terminal_time=problem.guess_duration)
    return stated


def _inlined(function: ca.Function, *arguments: Any) -> ca.MX:
    """Return the expression of the function in MAPTOR's symbols, without a function call."""
    expression: ca.MX = function.call(list(arguments), True, False)[0]
    return expression


def _constraints(expression: ca.MX, bounds: Interval, rows: tuple[int, ...]) -> Iterator[ca.MX]:
    for k in rows:
        lower, upper = float(bounds.lower[k]), float(bounds.upper[k])
        if lower == upper:
            yield expression[k] == lower
            continue
        if math.isfinite(lower):
            yield expression[k] >= lower
        if math.isfinite(upper):
            yield expression[k] <= upper


def _trajectory(problem: ProblemFunctions, found: Any) -> Trajectory:
    """Return the trajectory found: controls at the Radau points of each interval, states there and at the ends."""
    phase = found.phases[1]
    degrees = [int(degree) for degree in phase["mesh"]["polynomial_degrees"]]
    duration = float(phase["times"]["duration"])
    x, u = (
        np.array([found[(1, f"{letter}{i}")] for i in range(len(scale))]).T * scale
        for letter, scale in (("x", problem.state_scale), ("u", problem.control_scale))
    )
    nodes = 0.5 * (np.array(phase["mesh"]["mesh_nodes"], float) + 1.0)
    starts = np.cumsum([0, *(degree + 1 for degree in degrees)])  # states hold both ends of each interval
    firsts = np.cumsum([0, *degrees])
    times = np.array(phase["time_arrays"]["controls"]) / duration
    spans = list(zip(firsts[:-1], firsts[1:], nodes[:-1], np.diff(nodes), strict=True))
    return Trajectory(
        problem,
        duration,
        nodes,
        np.vstack([x[starts[:-1]], x[-1]]),
        tuple((times[a:b] - node) / width for a, b, node, width in spans),
        tuple(u[a:b] for a, b, _, _ in spans),
        float(found.status["objective"]),
    )
