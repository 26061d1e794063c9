"""A status says no more than was shown: OPTIMAL is a solution that replays within the tolerance."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import gated, solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.cops import goddard, hanging_chain
from mathnavi.controllers.ocp.replay import GIVEN_NODES, judged
from mathnavi.controllers.ocp.solution import ReplayResult, Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.interfaces.errors import ProblemError
from tests.controllers.ocp.statements import integrator, transfer
from tests.perturbed_starts import perturbed_starts


def test_a_programme_that_is_solved_is_not_yet_a_solution() -> None:
    coarse = solve(goddard(), 10)
    assert coarse.status is SolverOutcome.CONVERGED
    assert coarse.solved
    assert not coarse.ok
    assert coarse.replay is not None
    assert f"not within {GIVEN_NODES:g} when it is replayed: miss {coarse.replay.miss:.2g}" in coarse.message


@pytest.mark.parametrize("seed", [2, 8])
def test_whichever_false_minimum_rounding_leads_to_it_is_not_called_optimal(seed: int) -> None:
    with perturbed_starts(seed):
        found = solve(hanging_chain(), 40)
    assert not found.ok, found.message


def solution() -> Solution:
    return transfer(0.5, 1.0).solve(4)


def test_the_tolerance_is_the_callers() -> None:
    found = solution()
    assert found.status is SolverOutcome.OPTIMAL
    replay = ReplayResult(2e-4, 0.0, 0.3, 0.0, found.cost, found.x[-1], by_intervals=False)
    found = dataclasses.replace(found, replay=replay)
    assert judged(found, 1e-3).ok  # however far the parabolas left their bounds: what is flown does not
    finer = judged(found, 1e-4)
    assert not finer.ok
    assert finer.message == "not within 0.0001 when it is replayed: miss 0.0002"
    for wrong in (0.0, np.nan, "1e-6"):
        with pytest.raises(ProblemError, match=r"tolerance = .*; allowed: a finite value > 0"):
            judged(found, wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("figure", ["miss", "path_violation", "cost_error"])
@pytest.mark.parametrize("value", [2e-3, np.inf])
def test_one_figure_is_enough_to_lose_the_status(figure: str, value: float) -> None:
    found = solution()
    assert found.replay is not None
    worse = judged(dataclasses.replace(found, replay=dataclasses.replace(found.replay, **{figure: value})), 1e-3)
    assert worse.status is SolverOutcome.CONVERGED
    assert figure.replace("_", " ") in worse.message


def test_a_refused_solution_is_one_where_the_uniform_grid_is_accurate() -> None:
    even = solution()
    assert even.replay is not None
    moved = dataclasses.replace(even, replay=dataclasses.replace(even.replay, miss=1.0))
    refused = gated(moved, even, "moved", 1e-3)
    assert refused.status is SolverOutcome.REFUSED
    assert refused.ok
    assert not gated(moved, judged(even, 1e-300), "moved", 1e-300).ok


def longest(upper: float | None) -> OptimalControlProblem:
    ocp, _, _ = integrator(limit=1.0)
    limits = {} if upper is None else {"upper": upper}
    ocp.minimise(terminal=-ocp.free_duration(guess=1.0, **limits))
    return ocp


def test_a_final_time_at_a_limit_that_nobody_stated_is_no_solution() -> None:
    found = longest(None).solve(5)
    assert found.status is SolverOutcome.UNBOUNDED
    assert not found.ok
    assert found.message == "T ends at 1e+09 s, its default upper limit; state one, or a cost that bounds it"
    assert longest(5.0).solve(5).status is SolverOutcome.OPTIMAL


def test_nor_is_the_least_final_time() -> None:
    ocp, _, _ = integrator(limit=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=1.0))
    assert "T ends at 0.001 s, its default lower limit" in ocp.solve(5).message


def test_nor_is_a_limit_at_which_a_last_iterate_breaks_its_constraints() -> None:
    """A metre at 1 m/s in a millisecond is no flight whose cost has no least value."""
    ocp, x, _ = integrator(limit=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=1e-3))
    ocp.end(x, 1.0)
    assert ocp.solve(5, options=Options(iterations=1)).status is SolverOutcome.LIMIT
    assert ocp.solve(5).cost == pytest.approx(1.0)


def test_a_final_time_that_has_not_yet_come_to_its_limit_runs_away() -> None:
    ocp, x, u = integrator(limit=1.0)
    ocp.free_duration(guess=1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0)
    found = ocp.solve(5)
    assert found.status is SolverOutcome.UNBOUNDED
    assert found.message.startswith("T ")


def test_variables_that_run_away_are_named() -> None:
    ocp, x, _ = integrator()
    ocp.duration(1.0)
    ocp.minimise(terminal=-x)
    found = ocp.solve(5)
    assert found.status is SolverOutcome.UNBOUNDED
    assert "x runs to " in found.message
    assert "u runs to " in found.message


def test_a_state_that_runs_away_by_itself_is_named() -> None:
    ocp = OptimalControlProblem("free start")
    x = ocp.state("x")
    ocp.duration(1.0)
    ocp.dynamics(x, 0.0)
    ocp.minimise(terminal=-x)
    found = ocp.solve(5)
    assert found.status is SolverOutcome.UNBOUNDED
    assert found.message.startswith("x runs to ")


def test_a_large_value_that_is_meant_is_a_solution() -> None:
    ocp, x, _ = integrator(limit=1e12)
    ocp.duration(1.0)
    ocp.minimise(terminal=-x / 1e12)
    assert ocp.solve(5).status is not SolverOutcome.UNBOUNDED


@pytest.mark.parametrize(
    ("last", "found"),
    [
        (1.0, "t = 1 s of the last iterate, where x = -0.11"),  # the first step crosses the edge
        (0.0, "t = 2 s of the guess, where x = 0, u = 0"),
    ],
)
def test_a_derivative_that_is_not_finite_is_named(last: float, found: str) -> None:
    ocp = OptimalControlProblem("edge")
    x, u = ocp.state("x", guess=(1.0, last)), ocp.control("u")
    ocp.duration(2.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u - ca.sqrt(ca.fmax(x, 0.0)))  # finite for every x, its derivative for x > 0 only
    ocp.start(x, 1.0)
    ocp.end(x, -1.0)
    solution = ocp.solve(9)
    assert solution.status is SolverOutcome.NOT_FINITE
    assert solution.message.startswith(f"the derivative of the dynamics of x by x is not finite at {found}")
