"""Optimal control problems: what may be stated, and what is refused."""

from __future__ import annotations

import math
import re

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.sim.interfaces.errors import ProblemError


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


@pytest.mark.parametrize("missing", ["state", "dynamics", "duration", "stranger"])
def test_an_unfinished_problem_says_what_is_missing(missing: str) -> None:
    ocp = OptimalControlProblem("unfinished")
    if missing != "state":
        x, u = ocp.state("x"), ocp.control("u")
        if missing != "dynamics":
            ocp.dynamics(x, u if missing != "stranger" else ca.SX.sym("stranger"))
    if missing != "duration":
        ocp.duration(1.0)
    with pytest.raises(ProblemError, match=missing):
        ocp.functions()


def test_an_unknown_parameter_is_named_with_those_that_exist() -> None:
    ocp, *_ = double_integrator()
    ocp.parameter("mass", 1.0)
    with pytest.raises(ValueError, match=r"'weight' is not known; allowed: mass"):
        ocp.functions().values(weight=2.0)
