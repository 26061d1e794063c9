"""Optimal control problems: what may be stated, and what is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import casadi as ca
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


def double_integrator() -> tuple[OptimalControlProblem, ca.SX, ca.SX, ca.SX]:
    ocp = OptimalControlProblem("double integrator")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
    ocp.duration(1.0)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    return ocp, x, v, u


def test_functions_are_what_was_written() -> None:
    ocp, x, v, u = double_integrator()
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


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda ocp, x: ocp.state("x"), "'x' is empty or taken"),
        (lambda ocp, x: ocp.state("y", lower=2.0, upper=1.0), "lower = 2.0, upper = 1.0"),
        (lambda ocp, x: ocp.state("y", upper=math.nan), "upper = nan"),
        (lambda ocp, x: ocp.state("y", scale=0.0), "scale = 0.0"),
        (lambda ocp, x: ocp.control("w", guess=(0.0, math.nan)), "guess = [0.0, nan]"),
        (lambda ocp, x: ocp.free_duration(guess=1.0, lower=2.0), "lower = 2.0, guess = 1.0"),
        (lambda ocp, x: ocp.duration(-1.0), "duration"),
        (lambda ocp, x: ocp.duration(math.inf), "duration"),
        (lambda ocp, x: ocp.dynamics(x, ca.SX.sym("z", 2)), r"shape (2, 1)"),
        (lambda ocp, x: ocp.dynamics(x, 1.0), "given twice"),
        (lambda ocp, x: ocp.dynamics(ca.SX.sym("z"), 1.0), "not a state"),
        (lambda ocp, x: ocp.minimise(running=ca.SX.sym("z", 2)), "running cost"),
        (lambda ocp, x: [ocp.minimise(terminal=x) for _ in range(2)], "minimise() is called twice"),
        (lambda ocp, x: ocp.duration(1.0), "the duration is given twice"),
        (lambda ocp, x: ocp.parameter("k", math.inf), "parameter k = inf"),
        (lambda ocp, x: ocp.constrain(x, lower=1.0, upper=0.0), "path constraint"),
        (lambda ocp, x: ocp.end(ca.SX.sym("z"), 0.0), "not a state"),
    ],
)
def test_what_contradicts_itself_is_refused_by_name(wrong: object, named: str) -> None:
    ocp, x, _, _ = double_integrator()
    with pytest.raises(ProblemError, match=re.escape(named)):
        wrong(ocp, x)  # type: ignore[operator]


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


def test_an_unknown_parameter_is_named_with_those_that_exist() -> None:
    ocp, *_ = double_integrator()
    ocp.parameter("mass", 1.0)
    with pytest.raises(ValueError, match=r"'weight' is not known; allowed: mass"):
        ocp.functions().values(weight=2.0)


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
    chosen, expected = ocp.solve(9, **options), called(ocp.functions())
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
