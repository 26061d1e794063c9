"""Optimal control problems: what may be stated, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.methods.adaptation import distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.methods.by_name import MONITORS
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, Monitor
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array
from tests.controllers.ocp.statements import double_integrator


def test_functions_are_what_was_written() -> None:
    ocp, x, v, u = double_integrator()
    ocp.duration(1.0)
    k = ocp.parameter("k", 3.0)
    ocp.minimise(running=k * u**2 + ocp.t, terminal=x**2)
    ocp.constrain(x * v, upper=2.0)
    ocp.end(x, k)
    problem = ocp.functions()
    assert problem.dynamics([2.0, 5.0], 7.0, 0.0, 3.0).full().ravel().tolist() == [5.0, 7.0]
    assert float(problem.running_cost([2.0, 5.0], 7.0, 0.5, 3.0)) == 3.0 * 49.0 + 0.5
    assert float(problem.terminal_cost([2.0, 5.0], 1.0, 3.0)) == 4.0
    assert float(problem.path([2.0, 5.0], 7.0, 0.0, 3.0)) == 10.0
    assert float(problem.final([2.0, 5.0], 1.0, 3.0)) == -1.0
    assert problem.path_bounds.upper.tolist() == [2.0]
    assert problem.values(k=4.0).tolist() == [4.0]


def test_a_final_time_in_the_end_constraint_is_the_symbol_of_the_free_duration() -> None:
    ocp = OptimalControlProblem("at a given pace")
    x = ocp.state("x")
    ocp.dynamics(x, 1.0)
    final_time = ocp.free_duration(guess=2.0)
    ocp.end(x, 30.0 * final_time)
    assert float(ocp.functions().final(5.0, 2.0, [])) == 5.0 - 60.0


def test_guesses_of_different_lengths_meet_at_their_common_times() -> None:
    ocp = OptimalControlProblem("guess")
    x, y = ocp.state("x", guess=(0.0, 4.0, 2.0)), ocp.state("y", guess=(0.0, 3.0, 6.0, 9.0))
    ocp.duration(1.0)
    ocp.dynamics(x, 0.0)
    ocp.dynamics(y, 0.0)
    problem = ocp.functions()
    assert np.interp(0.25, problem.guess_times, problem.guess_states[:, 0]) == 2.0
    assert np.interp(0.25, problem.guess_times, problem.guess_states[:, 1]) == pytest.approx(2.25)


@pytest.mark.parametrize("missing", ["state", "dynamics", "duration"])
def test_an_unfinished_problem_says_what_is_missing(missing: str) -> None:
    ocp = OptimalControlProblem("unfinished")
    if missing != "state":
        x, u = ocp.state("x"), ocp.control("u")
        if missing != "dynamics":
            ocp.dynamics(x, u)
    if missing != "duration":
        ocp.duration(1.0)
    with pytest.raises(ProblemError, match=missing):
        ocp.functions()


def boundary_layers() -> OptimalControlProblem:
    """x' = -x^3 + u from 1 to 1.5 in 25 s: all happens at the ends, so the nodes matter."""
    ocp = OptimalControlProblem("boundary layers")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(25.0)
    ocp.minimise(running=(x**2 + u**2) / 2)
    ocp.dynamics(x, -(x**3) + u)
    ocp.start(x, 1.0)
    ocp.end(x, 1.5)
    return ocp


def speed(solution: Solution, tau: Array, epsilon: float) -> Array:
    w: Array = (epsilon + (solution.scaled_derivative(tau, 1) ** 2).sum(axis=1)) ** 0.25
    return w


OWN = Monitor("own", speed)
Called = Callable[[ProblemFunctions], Solution]


@pytest.mark.parametrize(
    ("options", "called"),
    [
        ({}, lambda problem: solve(problem, 9)),
        ({"method": "refine"}, lambda problem: refine(problem, 6, most_nodes=9)),
        ({"method": "redistribute"}, lambda problem: redistribute(problem, 9, CURVATURE)),
        ({"method": "redistribute", "monitor": "arclength"}, lambda problem: redistribute(problem, 9, ARCLENGTH)),
        ({"method": "redistribute", "monitor": OWN}, lambda problem: redistribute(problem, 9, OWN)),
        ({"method": "distribute"}, lambda problem: distribute(problem, 9)),
        (
            {"method": "distribute", "monitor": CURVATURE},
            lambda problem: distribute(problem, 9, Equidistributed(CURVATURE, CURVATURE.epsilon)),
        ),
    ],
)
def test_a_method_and_a_monitor_are_chosen_in_the_call(options: dict[str, Any], called: Called) -> None:
    ocp = boundary_layers()
    chosen, expected = ocp.solve(9, verify=False, **options), called(ocp.functions())
    assert (chosen.method, chosen.status) == (expected.method, expected.status)
    np.testing.assert_array_equal(chosen.grid.nodes, expected.grid.nodes)
    np.testing.assert_array_equal(chosen.x, expected.x)


@pytest.mark.parametrize("name", MONITORS)
def test_every_monitor_is_known_by_its_name(name: str) -> None:
    assert boundary_layers().solve(9, method="redistribute", monitor=name).method == f"redistribution, {name}"


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"method": "refined"}, "method = 'refined'; did you mean refine? allowed: auto, hp, direct, redistribute"),
        ({"method": None}, "method = None; allowed: auto, hp, direct"),
        ({"monitor": OWN}, "method = 'auto' takes none; allowed: a monitor with method redistribute, distribute"),
        ({"method": "refine", "monitor": "curvature"}, "method = 'refine' takes none"),
        ({"method": "redistribute", "monitor": "curvatur"}, "did you mean curvature? allowed: arclength, curvature"),
        ({"method": "redistribute", "monitor": 3}, "monitor = 3; allowed: arclength"),
        ({"method": "distribute", "monitor": OWN}, "monitor = 'own' has no measure"),
    ],
)
def test_a_method_or_a_monitor_that_does_not_fit_is_refused_by_name(options: dict[str, Any], named: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(named)):
        boundary_layers().solve(9, **options)
