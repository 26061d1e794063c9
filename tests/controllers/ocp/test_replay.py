"""The replay is honest: exact where the transcription is, and as wrong as the transcription where it is not."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson
from tests.controllers.ocp.statements import integrator, transfer


def problem_with(rate: float, upper: float = 10.0) -> ProblemFunctions:
    """x' = rate x + u from 1 to 0 over [0, 2], ∫ u^2."""
    ocp = OptimalControlProblem(f"rate {rate}")
    x, u = ocp.state("x", upper=upper, scale=2.0), ocp.control("u", guess=(-1.0,))
    ocp.duration(2.0)
    ocp.minimise(running=u**2, terminal=3.0)
    ocp.dynamics(x, rate * x + u)
    ocp.start(x, 1.0)
    ocp.end(x, 0.0)
    return ocp.functions()


def replay_of(solution: Solution) -> float:
    assert solution.replay is not None
    return solution.replay.error


def test_forward_euler_misses_by_what_its_step_leaves_out() -> None:
    solution = solve(problem_with(0.5), 21, scheme=Euler())
    assert solution.replay is not None
    x = 1.0
    for u, d in zip(solution.u[:, 0, 0], np.diff(solution.t), strict=True):
        x = np.exp(0.5 * d) * x + (np.exp(0.5 * d) - 1.0) / 0.5 * u
    assert solution.replay.end[0] == pytest.approx(x, abs=1e-9)
    assert solution.replay.miss == pytest.approx(abs(x - solution.x[-1, 0]) / 2.0, abs=1e-9)
    assert solution.replay.cost == pytest.approx(solution.cost, abs=1e-8)


def test_hermite_simpson_misses_by_less_the_more_nodes_it_has() -> None:
    misses = [replay_of(solve(problem_with(1.0), n)) for n in (5, 9, 17)]
    assert misses[0] > 8.0 * misses[1] > 64.0 * misses[2]


def test_an_ill_posed_open_loop_is_replayed_interval_by_interval() -> None:
    tame, wild = solve(problem_with(1.0), 41), solve(problem_with(12.0), 41)
    assert tame.replay is not None
    assert not tame.replay.by_intervals
    assert wild.replay is not None
    assert wild.replay.by_intervals
    assert wild.replay.miss < 1e-2 < 1.0 < wild.replay.one_piece  # what the intervals miss grows by e^24
    figures = f"by intervals, miss {wild.replay.miss:.2g}, and not in one piece, miss {wild.replay.one_piece:.2g}"
    assert figures in wild.message
    for row in (f"{wild.replay.miss:.2g}  by intervals", f"{wild.replay.one_piece:.2g}  in one piece"):
        assert row in repr(wild)
    assert "one piece" not in tame.message + repr(tame)
    wilder = replayed(dataclasses.replace(tame, problem=problem_with(200.0))).replay
    assert wilder is not None
    assert wilder.by_intervals  # by more than a number holds


def test_a_control_that_is_changed_is_found_out() -> None:
    solution = solve(problem_with(0.5), 11)
    bent = replayed(dataclasses.replace(solution, u=solution.u + 0.1))
    assert replay_of(bent) > 0.05 > 1e3 * replay_of(solution)


def test_what_is_flown_is_the_saturated_control() -> None:
    ocp, _, u = integrator("saturated", 1.0)
    ocp.duration(2.0)
    ocp.minimise(running=u**2)
    ocp.constrain(u - 0.9, upper=0.1)
    points = np.array([[[1.0], [1.0], [0.0]], [[0.0], [-0.5], [-1.0]]])  # a parabola with its top at 9/8 of the bound
    bent = dataclasses.replace(solve(ocp.functions(), 3), u=points)
    flown = replayed(bent).replay
    assert flown is not None
    assert flown.control_violation == pytest.approx(0.125 / 2.0, abs=1e-3)  # over the range from -1 to 1
    assert flown.path_violation < 1e-12  # so is what a path constraint sees
    t = np.linspace(0.0, 2.0, 20001)
    saturated = bent.control(t)[:, 0]
    assert saturated.max() == 1.0
    reached = ((saturated[1:] + saturated[:-1]) / 2.0 * np.diff(t)).sum()
    assert flown.end[0] == pytest.approx(reached, abs=1e-6)
    assert abs(reached - 1.0 / 3.0) > 0.03  # Simpson's rule over the parabolas: 5/6 - 1/2


def test_every_figure_of_a_replay_stands_for_itself() -> None:
    solution = solve(problem_with(0.5), 11)
    cheaper = replayed(dataclasses.replace(solution, cost=solution.cost - 10.0))
    assert cheaper.replay is not None
    assert cheaper.replay.cost_error == pytest.approx(10.0 / abs(cheaper.cost), rel=1e-3)
    assert max(cheaper.replay.miss, cheaper.replay.path_violation, cheaper.replay.control_violation) < 1e-4


def test_a_path_constraint_is_looked_at_on_the_replayed_path() -> None:
    ocp, x, u = integrator()
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.constrain(x - ca.sin(3.0 * ocp.t), lower=0.0)
    solution = solve(ocp.functions(), 5, scheme=HermiteSimpson())
    assert solution.replay is not None
    t = np.linspace(0.0, 1.0, 2001)
    assert solution.replay.path_violation == pytest.approx((np.sin(3.0 * t) - solution.state(t)[:, 0]).max(), rel=0.1)


def test_a_failed_solve_has_no_replay() -> None:
    solution = transfer(5.0, 1.0).solve(11)
    assert solution.status is SolverOutcome.INFEASIBLE
    assert solution.replay is None
