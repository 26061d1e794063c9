"""All intervals at once are flown as an integrator flies them, and only where it can be trusted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp.grid import uniform
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.replay import flight
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA

ENDS = np.array([0.0, 1.0])


def solved(name: str, nodes: int = 13) -> Solution:
    return transcription(PROBLEMS[name].problem(), RadauIIA(3), nodes).solve(grid=uniform(nodes))


@pytest.mark.parametrize("by_intervals", [False, True])
def test_it_ends_where_an_integrator_does(by_intervals: bool) -> None:
    solution = solved("cart-pole", 33)
    found = flight(solution, ENDS, 1e-10, by_intervals=by_intervals)
    assert found is not None
    problem, x, costs = solution.problem, solution.x[0], []
    for i, (start, end) in enumerate(zip(solution.t[:-1], solution.t[1:], strict=True)):

        def rates(t: float, y: np.ndarray, last: float = end) -> np.ndarray:
            u = solution.control(min(t, np.nextafter(last, 0.0)))
            f = problem.dynamics(y[:-1], u, t, solution.parameters).full()[:, 0]
            return np.append(f, float(problem.running_cost(y[:-1], u, t, solution.parameters)))

        y = np.append(solution.x[i] if by_intervals else x, 0.0)
        flown = solve_ivp(rates, (start, end), y, method="DOP853", rtol=1e-11, atol=1e-11)
        x, cost = flown.y[:-1, -1], flown.y[-1, -1]
        costs.append(cost)
        assert found.states[i, -1] == pytest.approx(x / problem.state_scale, abs=1e-8)
    assert found.costs == pytest.approx(costs, rel=1e-7)


def test_a_control_that_reaches_a_bound_inside_an_interval_is_left_to_an_integrator() -> None:
    solution = solved("cart-pole", 33)
    assert flight(dataclasses.replace(solution, u=3.0 * solution.u), ENDS, 1e-10, by_intervals=True) is None
