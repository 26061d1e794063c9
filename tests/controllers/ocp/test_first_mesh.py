"""Where hp begins: on a mesh that can follow the guess, at an integrator's steps, and near a solution."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.grid import uniform
from mathnavi.controllers.ocp.methods.guess_resolution import follows_guess
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.methods.initial_value import initial_value
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Transcription
from mathnavi.controllers.ocp.verification import cost_bound


def turning(turns: float) -> ProblemFunctions:
    """A guess that goes round a circle a number of times."""
    ocp = OptimalControlProblem("circle")
    x, y = (
        ocp.state(name, guess=lambda t, f=f: f(2.0 * math.pi * turns * t))
        for name, f in (("x", math.cos), ("y", math.sin))
    )
    u = ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(ca.vertcat(x, y), ca.vertcat(u, -u))
    return ocp.functions()


def test_a_mesh_follows_a_guess_that_turns_seldom_enough() -> None:
    assert follows_guess(turning(1.0), uniform(13), 3)
    assert not follows_guess(turning(6.0), uniform(13), 3)
    assert follows_guess(turning(6.0), uniform(25), 3)


def moving(rate: Callable[[ca.SX, ca.SX], ca.SX], duration: float, start: float) -> ProblemFunctions:
    """x' = rate(x, t) from a start: nothing is left to choose."""
    ocp = OptimalControlProblem("motion")
    x = ocp.state("x", guess=start)
    ocp.duration(duration)
    ocp.minimise(terminal=x)
    ocp.dynamics(x, rate(x, ocp.t))
    ocp.start(x, start)
    return ocp.functions()


@pytest.mark.parametrize(
    ("rate", "duration", "start"),
    [
        (lambda x, t: x**2, 2.0, 1.0),  # infinite at t = 1
        (lambda x, t: -ca.sqrt(x), 4.0, 1.0),  # 0 at t = 2, beyond which there is no root
        (lambda x, t: ca.log(x), 1.0, 0.0),
        (lambda x, t: 1.0 / x, 1.0, 0.0),
        (lambda x, t: 1e5 * ca.cos(1e5 * t), 1.0, 0.0),  # 16,000 periods
    ],
)
def test_a_motion_without_an_end_that_can_be_reached_is_left_to_the_solver(
    rate: Callable[[ca.SX, ca.SX], ca.SX], duration: float, start: float
) -> None:
    problem = moving(rate, duration, start)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert initial_value(problem, problem.nominal) is None


def test_nodes_are_where_a_motion_is_fast() -> None:
    problem = moving(lambda x, t: -1e4 * (x - ca.cos(t)), 1.0, 0.0)
    found = initial_value(problem, problem.nominal)
    assert found is not None
    grid, guess = found
    assert len(grid) <= 61
    assert np.median(grid.nodes) < 0.01
    assert guess.states_at(np.array([1.0]))[0, 0] == pytest.approx(math.cos(1.0), abs=1e-3)


def test_from_its_own_solution_hp_begins_near_it_and_from_another_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """A barrier as from any guess would lead away from a solution, and back or into another minimum."""
    problem = PROBLEMS["hypersensitive, short"].problem()
    first = hp(problem)
    warm, solve = list[bool](), Transcription.solve

    def watched(self: Transcription, *args: Any, **named: Any) -> Solution:
        warm.append(self._options.warm)
        return solve(self, *args, **named)

    monkeypatch.setattr(Transcription, "solve", watched)
    again = hp(problem, guess=first)
    assert warm[0]
    assert again.status is SolverOutcome.OPTIMAL
    assert again.cost == pytest.approx(first.cost, rel=1e-7)
    warm.clear()
    hp(problem, guess=dataclasses.replace(first, problem=PROBLEMS["hypersensitive"].problem()))
    assert not warm[0]


def test_a_guess_that_no_first_mesh_follows_costs_no_try(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of readings with noise: the meshes are tried in their usual order."""
    tried, solve = list[int](), Transcription.solve

    def failing(self: Transcription, *args: Any, **named: Any) -> Solution:
        tried.append(self.nodes)
        return dataclasses.replace(solve(self, *args, **named), status=SolverOutcome.LIMIT)

    monkeypatch.setattr(Transcription, "solve", failing)
    assert not hp(turning(40.0)).solved
    assert tried[:3] == [13, 25, 41]


def test_a_lower_minimum_on_either_finer_mesh_is_where_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    found = hp(PROBLEMS["stirred tank"].problem())

    def with_costs(*factors: float) -> Callable[..., Solution]:
        costs = dict(zip(cost_bound.PARTS, factors, strict=True))
        return lambda solution, parts, options: dataclasses.replace(solution, cost=costs[parts] * solution.cost)

    for factors, chosen in (((1.0, 0.5), 0.5), ((0.5, 1.0), 0.5), ((1.0 + 1e-6, 1.0), 1.0 + 1e-6)):
        monkeypatch.setattr(cost_bound, "on_finer_mesh", with_costs(*factors))
        bound = cost_bound.cost_bound(found, None)  # type: ignore[arg-type]
        assert bound.finer.cost == pytest.approx(chosen * found.cost, rel=1e-12)
