"""A problem of ``mathnavi.controllers.ocp`` as MAPTOR takes it.

MAPTOR collocates at Legendre-Gauss-Radau points and refines its mesh by degree and by interval until the relative error
of the states is below a tolerance; IPOPT in CasADi solves each mesh. The dynamics, costs and constraints are the very
CasADi functions of the problem, the states and controls are over the problem's scales, the guess is the problem's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.sim.interfaces.signals import Array

NAME = "MAPTOR"
DEGREE, INTERVALS = 4, 5  # of the first mesh, like those of its examples
IPOPT = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-9, "ipopt.max_iter": 500}


def prepared(problem: ProblemFunctions, tolerance: float) -> Callable[[], float | None]:
    """Function that solves the problem to MAPTOR's ``tolerance`` and returns J, None where it did not converge."""
    import maptor

    stated = _stated(problem)

    def solved() -> float | None:
        found = maptor.solve_adaptive(stated, error_tolerance=tolerance, nlp_options=IPOPT, show_summary=False)
        return float(found.status["objective"]) if found.status["success"] else None

    return solved


def _stated(problem: ProblemFunctions) -> Any:
    import maptor

    stated = maptor.Problem("benchmark")
    phase = stated.set_phase(1)
    shortest, longest = problem.duration_bounds
    time = phase.time(initial=0.0, final=(shortest, longest) if problem.free_duration else shortest)
    states = [
        phase.state(f"x{i}", boundary=_limits(problem.state_bounds, i, scale))
        for i, scale in enumerate(problem.state_scale)
    ]
    controls = [
        phase.control(f"u{i}", boundary=_limits(problem.control_bounds, i, scale))
        for i, scale in enumerate(problem.control_scale)
    ]
    p, scale = ca.DM(problem.nominal), ca.DM(problem.state_scale)
    x = ca.vertcat(*(state() for state in states)) * scale
    u = ca.vertcat(*controls) * ca.DM(problem.control_scale)
    start = ca.vertcat(*(state.initial for state in states)) * scale
    end = ca.vertcat(*(state.final for state in states)) * scale
    rates = problem.dynamics(x, u, time(), p) / scale
    phase.dynamics({state: rates[i] for i, state in enumerate(states)})
    for expression, bounds in (
        (problem.initial(start, p), problem.initial_bounds),
        (problem.final(end, time.final, p), problem.final_bounds),
    ):
        for constraint in _constraints(expression, bounds):
            phase.event_constraints(constraint)
    for constraint in _constraints(problem.path(x, u, time(), p), problem.path_bounds):
        phase.path_constraints(constraint)
    running = phase.add_integral(problem.running_cost(x, u, time(), p))
    stated.minimize(problem.terminal_cost(end, time.final, p) + running)
    phase.mesh([DEGREE] * INTERVALS, np.linspace(-1.0, 1.0, INTERVALS + 1))
    guess_x, guess_u = (_guess(problem, DEGREE + 1, "states"), _guess(problem, DEGREE, "controls"))
    phase.guess(states=guess_x, controls=guess_u, terminal_time=problem.guess_duration)
    return stated


def _limits(bounds: Interval, i: int, scale: float) -> tuple[float | None, float | None] | None:
    """Bounds over the scale; None for no bound, and for neither."""
    pair = [float(side[i] / scale) if math.isfinite(side[i]) else None for side in bounds]
    return None if pair == [None, None] else (pair[0], pair[1])


def _constraints(expression: ca.MX, bounds: Interval) -> Iterator[ca.MX]:
    for k, (lower, upper) in enumerate(zip(*bounds, strict=True)):
        if lower == upper:
            yield expression[k] == float(lower)
            continue
        if math.isfinite(lower):
            yield expression[k] >= float(lower)
        if math.isfinite(upper):
            yield expression[k] <= float(upper)


def _guess(problem: ProblemFunctions, points: int, kind: str) -> list[Array]:
    """The problem's guess over its scale, (n, points) for each interval of the first mesh."""
    values, scale = {
        "states": (problem.guess_states, problem.state_scale),
        "controls": (problem.guess_controls, problem.control_scale),
    }[kind]
    guesses = []
    for interval in range(INTERVALS):
        at = (interval + np.linspace(0.0, 1.0, points)) / INTERVALS
        columns = [np.interp(at, problem.guess_times, column) for column in values.T]
        guesses.append(np.array(columns) / scale[:, None])
    return guesses
